"""A study through a lab's own files of a panel and a camera: each fault of them is named, and nothing is lost."""

import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import holobench_eval as hb
from holobench_eval.commands.own.new import write_code
from holobench_eval.core.errors import UserError
from holobench_eval.lab.bench_file import load_bench_file
from holobench_eval.study.opening import forget_sessions
from holobench_eval.testing import table
from tests.lab.session.running import run, succeed
from tests.study.studies import exchanged, write_study

PAGE = Path(__file__).parents[2] / "docs" / "real-bench.md"
BENCH = re.findall(r"```yaml\n(# table.yaml\n.*?)```", PAGE.read_text(encoding="utf-8"), flags=re.DOTALL)[0]
METHODS = ("{name: wirtinger, params: {iterations: 5}}", "{name: online_camera, captures: 6}")


class Frames:
    """The simulated camera's frames, which a fault spoils from when it begins."""

    def __init__(self) -> None:
        self.grab, self.all = table.grab, list[Any]()
        self.fault: Callable[[list[Any]], Any] = lambda frames: frames[-1]
        self.begins: Callable[[], bool] = lambda: True

    def __call__(self, seconds: float, bits: int) -> Any:
        self.all.append(self.grab(seconds, bits))
        return self.fault(self.all) if self.begins() else self.all[-1]


def unplugged(_: object) -> Any:
    raise OSError("no such\ndevice")


@pytest.fixture
def frames(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Frames]:
    """A folder with a study, a bench file and files of its devices, just as ``holoeval new`` writes them."""
    for kind in ("camera", "panel"):
        write_code(f"my_{kind}", tmp_path, kind)
    (tmp_path / "bench.yaml").write_text(BENCH)
    write_study(tmp_path / "study.yaml", *METHODS, display="{bench: bench.yaml}")
    frames = Frames()
    monkeypatch.setattr(table, "grab", frames)
    forget_sessions()
    yield frames
    forget_sessions()


def study(folder: Path) -> tuple[str, str]:
    """What a run says, and the line with which it ends."""
    return run("run", folder / "study.yaml", "--output", folder / "out")


@pytest.mark.parametrize(
    ("fault", "said"),
    [
        (unplugged, "simulated camera: taking a picture failed: OSError: no such device"),
        (lambda frames: frames[-1][None], "gave uint16 of (1, 201, 201); expected whole counts"),
        (lambda frames: frames[-1][: 200 + len(frames) % 2], "201) follows one of (20"),
        (lambda frames: frames[-1].astype(float), "gave float64 of (201, 201)"),
        (lambda _: None, "gave object of ()"),
        (lambda frames: frames[-1] * 16, "counts, but 4095 are its white"),
        (lambda frames: np.minimum(frames[-1], 255), "its counts end at 255, below its white of 4095"),
        (
            lambda frames: frames[-1] & 0xFFF0,
            "its counts end at 4080 (all are multiples of 16), below its white of 4095",
        ),
        (lambda frames: frames[-2:][0], "frame 2 after an exposure was set is the first with it"),
        (lambda frames: frames[-5:][0], "frame 5 after an exposure was set is the first with it"),
        (lambda frames: frames[0], "gives one and the same frame, byte for byte"),
    ],
)
def test_a_camera_with_a_fault_is_named_before_anything_is_computed(frames, tmp_path, fault, said):
    frames.fault = fault
    assert said in study(tmp_path)[1]
    assert not (tmp_path / "out").exists()


def test_a_method_captures_live_and_a_camera_that_is_unplugged_costs_nothing_that_the_same_command_does_not_add(
    frames, tmp_path
):
    records = tmp_path / "out" / "records"
    frames.fault, frames.begins = unplugged, lambda: len(list(records.glob("*.json"))) > 5  # all but online_camera
    _, failure = study(tmp_path)
    assert "does not answer any more: simulated camera: taking a picture failed: OSError: no such device" in failure
    kept = {path: path.read_text() for path in records.glob("*.json")}
    assert len(kept) == 6
    assert not any('"failed"' in text for text in kept.values())
    frames.begins = lambda: False
    assert not study(tmp_path)[1]
    assert all(path.read_text() == text for path, text in kept.items())
    scores = pd.read_csv(tmp_path / "out" / "table.csv").set_index("label")
    assert scores.loc["online_camera", "captures"] == 1 + 6  # the first attempt's counts
    assert scores.loc["online_camera", "psnr_linear_db"] > scores.loc["wirtinger", "psnr_linear_db"]


def test_a_device_that_is_edited_takes_new_photographs_and_travels_with_a_session(frames, tmp_path):
    names = [load_bench_file(tmp_path / "bench.yaml").digest]
    succeed("session", "export", tmp_path / "study.yaml", tmp_path / "session")
    (tmp_path / "my_camera.py").write_text((tmp_path / "my_camera.py").read_text() + "# changed\n")
    names += [load_bench_file(tmp_path / each / "bench.yaml").digest for each in ("", "session")]
    assert names[0] == names[2] != names[1]


class Wall:
    """A panel of a notebook's own."""

    shape = table.PANEL

    def show(self, levels):
        """Show levels."""
        table.write(levels)


class Eye:
    """A camera of a notebook's own."""

    white, exposures = 4095, (1e-5, 1.0)

    def expose(self, seconds):
        """A frame."""
        return table.grab(seconds, 12), seconds


def test_open_devices_take_the_place_of_those_of_a_file(frames, tmp_path, capsys):
    (tmp_path / "bench.yaml").write_text(exchanged(BENCH, ("slm: {driver: my_panel.py:MyPanel}\n", "")))
    display = hb.open_bench(tmp_path / "bench.yaml", slm=Wall(), camera=Eye())
    assert "panel: slm Wall; camera: camera Eye" in capsys.readouterr().out
    target = display.target(np.full((60, 60, 3), 0.5))
    phase = display.solve("double_phase", target)
    assert 0.5 < display.capture(phase, target).mean() / display.ideal(phase).mean() < 2
    with pytest.raises(UserError, match="camera Wall: it has no 'expose'"):
        hb.open_bench(tmp_path / "bench.yaml", slm=Wall(), camera=Wall())
