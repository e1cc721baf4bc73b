"""One picture is solved by one command, whose study can be run again."""

import re
from functools import partial
from pathlib import Path
from zipfile import ZipFile

import cv2
import numpy as np
import pandas as pd
import pytest
import typer

from holobench_eval.commands.options import ARTIFACTS, learned_folder
from holobench_eval.commands.solve import MOST, _entries, _leave, _study, solve
from holobench_eval.core.errors import UserError
from holobench_eval.core.installed import shipped_configs
from holobench_eval.core.io import file_name
from holobench_eval.study.scoring import picture as picture_scoring
from tests.study.studies import planned

FUNCTION = '''
import torch


def flat(target, bench):
    """A flat phase."""
    return torch.zeros(*target.shape[:2], *bench.spec.shape)
'''


@pytest.fixture
def picture(tmp_path, monkeypatch, in_process):
    monkeypatch.chdir(tmp_path)
    image = np.random.default_rng(1).integers(0, 256, (12, 15, 3)).astype(np.uint8)
    cv2.imwrite("my picture.png", cv2.resize(image, (300, 240)))
    return Path("my picture.png")


def files(folder):
    return sorted(path.relative_to(folder).as_posix() for path in Path(folder).rglob("*") if path.is_file())


@pytest.mark.slow
def test_ten_files_are_left_and_what_was_computed_is_in_one_of_them(picture, capsys, monkeypatch):
    Path("mine.py").write_text(FUNCTION)
    folder, call = Path("holoeval-results", "my picture"), partial(solve, display="ideal", panel=(128, 128))
    call("double_phase, mine.py:flat", picture)
    printed = capsys.readouterr().out
    of_both = [f"{what}/{label}.png" for what in ("captures", "phases") for label in ("double_phase", "flat")]
    left = sorted(
        [*of_both, "picture/my picture.png", "pictures.jpg", "report.html", "study.yaml", "study.zip", "table.csv"]
    )
    assert files(folder) == left
    assert all(f"{folder / name}" in printed for name in left if "study" not in name and "picture/" not in name)
    assert {path.name for path in folder.parent.iterdir()} == {"my picture", "solved"}
    assert set(pd.read_csv(folder / "table.csv")["label"]) >= {"double_phase", "flat"}
    names = ZipFile(folder / "study.zip").namelist()
    assert {"records.csv", "details.md", f"phases/flat/ideal/{file_name(picture.name)}.npy"} <= {*names}

    monkeypatch.setattr(picture_scoring, "keep_pictures", None)  # whoever computes a cell again fails
    before = (folder / "table.csv").read_bytes()
    call("double_phase, mine.py:flat", picture)
    assert (files(folder), (folder / "table.csv").read_bytes()) == (left, before)


@pytest.mark.slow
def test_a_failed_method_leaves_the_files_of_the_others_and_its_traces(picture, capsys):
    Path("mine.py").write_text(FUNCTION.replace("return", "return missing +"))
    with pytest.raises(typer.Exit):
        solve("double_phase, mine.py:flat", picture, display="ideal", panel=(128, 128), output=Path("out"))
    assert {"phases/double_phase.png", "captures/double_phase.png", "report.html"} <= {*files("out")}
    (traces,) = Path(".out/records").glob("*.log")
    assert "missing" in traces.read_text()
    assert "tracebacks: .out/records/*.log" in capsys.readouterr().out


@pytest.mark.parametrize(("methods", "frames", "shown"), [(3, 1, {"phases"}), (5, 1, set()), (1, 8, {"captures"})])
def test_of_more_methods_or_frames_a_kind_is_in_the_archive_alone(tmp_path, methods, frames, shown):
    labels = [f"m{number}" for number in range(methods)]
    for name in ("report.html", "table.csv", "figures/answer-pictures.jpg"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()
    for what, many in (("phases", frames), ("captures", 1)):
        for label in labels:
            (tmp_path / what / label / "ideal").mkdir(parents=True)
            for number in range(many):
                (tmp_path / what / label / "ideal" / f"my-frame-{number}.png").touch()
    (tmp_path / "left").mkdir()
    _leave(tmp_path, tmp_path / "left", labels)
    found = files(tmp_path / "left")
    assert {name.partition("/")[0] for name in found if "/" in name} == shown
    assert len(found) <= MOST - 3


def test_what_table_3_trained_serves_to_solve(picture):
    config = Path("out/study.yaml")
    Path("out/picture").mkdir(parents=True)
    picture.rename(Path("out/picture") / picture.name)
    config.write_text(_study(["hil"], Path("out/picture") / picture.name, "leto-2020", (256, 256), Path("out")))
    (own,) = planned(config).preparations()
    assert own in planned(shipped_configs()["table3"]).preparations()


def test_parameters_are_set_of_each_method_or_of_one(picture):
    given = ["iterations=1", "training.steps=2", "hil.network.width=8"]
    hil, plus = _entries(["hil", "hil_plus"], given)
    assert hil["params"] == {"iterations": 1, "training": {"steps": 2}, "network": {"width": 8}}
    assert plus["params"] == {"iterations": 1, "training": {"steps": 2}}
    assert _entries(["wirtinger", "double_phase"], ["wirtinger.iterations=3"])[1] == "double_phase"
    for key in ("mine.py:CamMethod", "CamMethod"):  # the label that tables print
        assert _entries(["mine.py:CamMethod", "wirtinger"], [f"{key}.captures=5"])[0]["params"] == {"captures": 5}
    with pytest.raises(UserError, match=r"--set CamMehtod.x=5: no method 'CamMehtod' among hil, wirtinger, and no key"):
        _entries(["hil", "wirtinger"], ["CamMehtod.x=5"])
    with pytest.raises(UserError, match="--set loss: expected key=value"):
        _entries(["wirtinger"], ["loss"])


def test_the_networks_of_the_clone_are_found_from_any_folder(tmp_path, monkeypatch):
    grid, root = planned(shipped_configs()["table3"]), Path(__file__).parents[2]
    monkeypatch.chdir(tmp_path)
    assert learned_folder(ARTIFACTS, grid) == root / "artifacts"
    assert learned_folder(Path("mine"), grid) == Path("mine")
    ARTIFACTS.mkdir()
    assert learned_folder(ARTIFACTS, grid) == ARTIFACTS


def test_a_display_of_one_laser_is_called_by_no_other_colour(picture, capsys):
    panel = "panel: {wavelengths: [532e-9]}"
    Path("one.yaml").write_text(f"name: one\nversion: 1\nseed: 1\ndescription: One.\nlike: leto-2020\n{panel}\n")
    solve("double_phase", picture, display="one.yaml", panel=(128, 128), output=Path("out"))
    assert "shown in gray, by the one wavelength of the display" in capsys.readouterr().out
    kept = ZipFile("out/study.zip")
    (note,) = (name for name in kept.namelist() if name.startswith("captures/") and name.endswith(".json"))
    written = "".join(kept.read(name).decode() for name in ("details.md", "columns.md", note))
    assert not re.findall(r"\b(?:red|green|R/G/B)\b", written)


def test_a_report_of_other_methods_pictures_or_displays_stays(picture):
    solve("double_phase", picture, display="ideal", panel=(128, 128))
    cv2.imwrite(str(picture), np.full((120, 120), 90, np.uint8))
    for display in ("ideal", "leto-mild"):
        solve("double_phase", picture, display=display, panel=(128, 128))
    names = ["my picture", "my picture-2", "my picture-3"]
    left = [Path("holoeval-results", name, file) for name in names for file in ("report.html", "study.yaml")]
    texts = [file.read_text() for file in left]
    assert len(set(texts)) == 6
    solve("double_phase", picture, display="ideal", panel=(128, 128))  # the second once more
    assert sorted(path.name for path in Path("holoeval-results").iterdir()) == [*names, "solved"]
    for method in ("gerchberg_saxton", "wirtinker"):
        with pytest.raises(UserError, match=r"holds the work of other methods, parameters or displays; choose another"):
            solve(method, picture, display="ideal", panel=(128, 128), output=Path("holoeval-results", names[1]))
    assert [file.read_text() for file in left] == texts


@pytest.mark.parametrize("name", ["other.png", "my picture.png"])
def test_a_folder_holds_one_picture_and_another_is_not_replaced(picture, name):
    kept = Path("out", "picture", name)
    kept.parent.mkdir(parents=True)
    kept.write_bytes(b"another")
    with pytest.raises(UserError, match=rf"holds another {name}; choose another --output"):
        solve("double_phase", picture, output=Path("out"))
    assert kept.read_bytes() == b"another"


def test_files_of_others_are_not_replaced(picture):
    Path("own").mkdir()
    Path("own", "study.yaml").write_text("mine")
    Path("file").write_text("mine")
    for other in ("own", "own/study.yaml", "file"):
        with pytest.raises(UserError, match=f"{other}: is not a folder of solve and not empty"):
            solve("double_phase", picture, output=Path(other))
    assert Path("own", "study.yaml").read_text() == Path("file").read_text() == "mine"
    assert [path.name for path in Path("own").iterdir()] == ["study.yaml"]


@pytest.mark.parametrize(
    ("methods", "name", "changes", "message"),
    [
        ("wirtinker", "", {}, "unknown method 'wirtinker'"),
        ("", "", {}, "methods"),
        ("double_phase", "", {"panel": (20, 20)}, "panel"),
        ("double_phase", "", {"panel": (5000, 5000)}, "the panel of 'leto-2020' has 1080 x 1920 pixels, not"),
        ("wirtinger", "", {"values": ["Wirtinger.step=1"]}, "no method 'Wirtinger' among wirtinger"),
        ("double_phase", "", {"display": "leto"}, "leto"),
        ("double_phase", "", {"display": "mine.yaml"}, "profile 'mine.yaml': no such file: mine.yaml"),
        ("phases", "", {}, "none of the files that it reads is there"),
        ("double_phase", "gone.png", {}, "gone.png: no such file"),
        ("double_phase", "text.png", {}, "text.png: not an image"),
        ("double_phase", "picture", {}, "not a picture by its name"),
        ("double_phase", ".hidden.png", {}, "not a picture by its name"),
        ("wirtinger", "", {"values": ["iterations=many"]}, "'iterations': input should be a whole number, got 'many'"),
        ("wirtinger,double_phase", "", {"values": ["iterations=2"]}, "'double_phase' has no parameter 'iterations'"),
        ("my picture.png", "wirtinger", {}, r"the picture comes second: holoeval solve METHODS my picture\.png"),
    ],
)
def test_what_is_refused_is_said_of_the_command_and_leaves_nothing(picture, methods, name, changes, message, capsys):
    for other in ("picture", ".hidden.png"):
        Path(other).write_bytes(picture.read_bytes())
    Path("text.png").write_text("text")
    with pytest.raises(UserError, match=message) as refused:
        solve(methods, Path(name or picture), output=Path("out"), **changes)
    assert "study.yaml" not in str(refused.value)
    assert not Path("out").exists()
    assert capsys.readouterr().out == ""
