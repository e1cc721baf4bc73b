"""One command makes a twin of a display, and says how far it can stand for that."""

import json
from functools import partial
from pathlib import Path

import pytest
import yaml

from holobench_eval.commands.twin import twin
from holobench_eval.core.errors import UserError
from holobench_eval.display import load_profile
from holobench_eval.methods.calibrated import patterns
from holobench_eval.methods.twin import method
from holobench_eval.methods.wirtinger import Wirtinger
from holobench_eval.report.description import basis
from holobench_eval.study import twin as twins
from tests.study.studies import write_green
from tests.support.small_training import QUICK, SHORT_OPEN_LOOP

PANEL = (128, 128)


@pytest.fixture
def quick(monkeypatch, tmp_path, in_process):
    """A folder where twins learn next to nothing, at once."""
    whole = twins.study_text

    def text(display: str, panel: tuple[int, int], pictures: int, network: str | None = None) -> str:
        config = yaml.safe_load(whole(display, panel, pictures))
        config["methods"] = [
            "double_phase",
            {"name": "wirtinger", "params": {"iterations": 3}},
            {"name": network or "twin", "params": QUICK[network or "twin"]},
        ]
        config["training"]["params"]["count"] = 4
        config["protocol"]["metrics"] = ["psnr"]
        return yaml.safe_dump(config)

    monkeypatch.setattr(twins, "study_text", text)
    monkeypatch.setattr(method, "OPEN_LOOP", SHORT_OPEN_LOOP)
    monkeypatch.setattr(patterns, "Wirtinger", partial(Wirtinger, iterations=5))
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.slow
def test_a_display_becomes_a_profile_that_says_how_far_it_can_be_trusted(quick, capsys):
    display = str(write_green(quick, "leto-aged"))
    twin(display, Path("lab"), panel=PANEL, pictures=3)
    profile = load_profile("lab/lab.yaml")
    assert (profile.name, profile.version, profile.twin.of) == ("lab", 1, "green")
    assert profile.spec().shape == PANEL
    assert "illumination.amplitude" in profile.held
    assert profile.twin.pictures == 3
    assert len(profile.twin.light) == len(profile.twin.place) == 1
    assert profile.twin.gap.keys() == {"double_phase", "wirtinger", "twin"}
    photographs = json.loads(next(Path("artifacts").glob("twin-*/provenance.json")).read_text())["captures"]
    assert profile.twin.photographs == photographs
    printed, report = capsys.readouterr().out, Path("lab/report.md").read_text()
    assert "Flattery: holograms made through the twin" in printed
    assert "| lab-turned |" in report
    assert "| twin (flattery) |" in report
    assert all((Path("lab") / name).is_file() for name in ("pictures.jpg", "scores.png", "work/photographs/report.md"))
    assert basis(profile).startswith(f"simulated, a twin of green, trained with {photographs} photographs: its captur")
    Path("lab/lab.npz").unlink()
    source = twins.in_folder(Path("lab"), Path("artifacts"))
    again, *_ = twins.write_trial(source, "lab", Path("lab"))
    assert load_profile(str(twins.publish(again, source, Path("lab")))).version == 2
    with pytest.raises(UserError, match=r"^lab: holds the twin of another display or of other settings"):
        twin("ideal", Path("lab"), panel=PANEL, pictures=3)


@pytest.mark.parametrize(
    ("arguments", "fault"),
    [
        (["nosuch", "-o", "lab"], "unknown profile 'nosuch'"),
        (["leto-aged", "-o", "my lab"], "my lab: the folder names the display; expected a-z"),
        (["empty", "-o", "lab"], "empty: a folder without manifest.json"),
        (["pluto-fourier", "-o", "lab"], "pluto-fourier: has its picture in a Fourier plane; the model of a twin"),
        (["ideal", "-o", "odd"], "odd.yaml: is no twin of 'ideal'"),
        (["mine.yaml", "-o", "."], "mine.yaml: is no twin of 'mine'; choose another --output"),
        (["eye.yaml", "-o", "lab"], "'eye': a display that is seen through a known lens has no twin"),
        (["bench.yaml", "-o", "lab", "--panel", "128", "128"], "bench.yaml: a bench has the panel that its file says"),
        (["ideal", "-o", "lab", "--network", "sgd"], "'sgd' cannot be a display; expected a method of this package"),
        (["ideal", "-o", "lab", "--network", "own.py:Own"], "'own.py:Own' cannot be a display; expected a method of t"),
        (["ideal", "-o", "lab", "--network", "nothing"], "'nothing' cannot be a display; expected a method of this"),
    ],
)
def test_what_cannot_be_is_one_line(arguments, fault, tmp_path, monkeypatch, call):
    folder = tmp_path / "mine"
    folder.mkdir()
    monkeypatch.chdir(folder)
    Path("empty").mkdir()
    Path("odd").mkdir()
    Path("odd/odd.yaml").write_text("twin: many\n")
    Path("mine.yaml").write_text("like: leto-aged\nname: mine\n")
    Path("eye.yaml").write_text("like: leto-2020\nname: eye\neye: {focus: [0.2, 0, 0], known: true}\n")
    Path("bench.yaml").write_text("name: mine\nslm: {}\n")
    code, _, printed = call("twin", *arguments)
    assert (code, printed.count("\n")) == (2, 1)
    assert fault in printed
    assert not list(folder.rglob("photographs.yaml"))  # so that the next call is not refused
    assert Path("mine.yaml").read_text() == "like: leto-aged\nname: mine\n"


KINDS = {
    "name: a\nseed: 3\n": False,
    "like: ideal\n": False,
    "name: a\nrelay: {}\n": False,
    "- 1": False,
    "name: a\nslm: {}\n": True,
    "name: a\nversion: 1\npanel: {}\n": True,
}


@pytest.mark.parametrize(("text", "is_bench"), KINDS.items())
def test_the_file_of_a_bench_is_told_from_a_profile(text, is_bench, tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_text(text)
    assert twins.is_bench(path) == is_bench
    assert ("bench" in yaml.safe_load(twins.study_text(str(path), (128, 128), 3))["display"]) == is_bench


@pytest.mark.slow
def test_a_trained_method_becomes_a_display_that_a_study_runs_on(quick):
    twin(str(write_green(quick, "leto-aged")), Path("net"), panel=PANEL, pictures=3, network="parametric_model")
    profile = load_profile("net/net.yaml")
    assert (profile.network.method, profile.twin.of, profile.twin.pictures) == ("parametric_model", "green", 3)
    assert profile.twin.light == ()
    assert "net-turned" not in Path("net/report.md").read_text()
    assert basis(profile).startswith("predicted by a trained parametric_model, a twin of green, trained with")
