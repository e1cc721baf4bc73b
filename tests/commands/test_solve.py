"""One picture is solved by one command, whose study can be run again."""

import re
from pathlib import Path

import cv2
import numpy as np
import pandas as pd
import pytest

from holobench_eval.commands.options import ARTIFACTS, learned_folder
from holobench_eval.commands.solve import _entries, _study, solve
from holobench_eval.core.errors import UserError
from holobench_eval.core.installed import shipped_configs
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


@pytest.mark.slow
def test_several_methods_give_phases_captures_scores_and_a_picture(picture, capsys):
    Path("mine.py").write_text(FUNCTION)
    solve("double_phase, mine.py:flat", picture, display="ideal", panel=(128, 128))
    folder, printed = Path("holoeval-results", "my picture"), capsys.readouterr().out.replace("\n", "")
    for path in ("figures/answer-pictures.jpg", "phases/double_phase", "captures/flat"):
        assert str(folder / path) in printed
        assert (folder / path).exists()
    assert set(pd.read_csv(folder / "table.csv")["label"]) >= {"double_phase", "flat"}


def test_what_table_3_trained_serves_to_solve(picture):
    config = Path("out/study.yaml")
    Path("out/picture").mkdir(parents=True)
    picture.rename(Path("out/picture") / picture.name)
    config.write_text(_study(["hil"], Path("out/picture") / picture.name, "leto-2020", (256, 256), Path("out")))
    (own,) = planned(config).preparations()
    assert own in planned(shipped_configs()["table3"]).preparations()


def test_parameters_are_set_of_each_method_or_of_one(picture):
    given = ["rounds=1", "training.rate=2e-3", "mine.py:f.n=3", "wirtinger.loss=l1"]
    wirtinger, mine = _entries(["wirtinger", "mine.py:f"], given)
    assert wirtinger["params"] == {"rounds": 1, "training": {"rate": 0.002}, "loss": "l1"}
    assert mine["params"] == {"rounds": 1, "training": {"rate": 0.002}, "n": 3}
    assert _entries(["wirtinger", "double_phase"], ["wirtinger.iterations=3"])[1] == "double_phase"
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
    (note,) = Path("out/captures").rglob("*.json")
    written = "".join(Path("out", name).read_text() for name in ("details.md", "columns.md", note.relative_to("out")))
    assert not re.findall(r"\b(?:red|green|R/G/B)\b", written)


def test_a_report_of_other_methods_pictures_or_displays_stays(picture):
    solve("double_phase", picture, display="ideal", panel=(128, 128))
    cv2.imwrite(str(picture), np.full((120, 120), 90, np.uint8))
    for display in ("ideal", "leto-mild"):
        solve("double_phase", picture, display=display, panel=(128, 128))
    names = ["my picture", "my picture-2", "my picture-3"]
    files = [Path("holoeval-results", name, file) for name in names for file in ("report.md", "study.yaml")]
    texts = [file.read_text() for file in files]
    assert len(set(texts)) == 6
    solve("double_phase", picture, display="ideal", panel=(128, 128))  # the second once more
    assert sorted(path.name for path in Path("holoeval-results").iterdir()) == [*names, "solved"]
    for method in ("gerchberg_saxton", "wirtinker"):
        with pytest.raises(UserError, match=r"holds the report of other methods or of another display; choose another"):
            solve(method, picture, display="ideal", panel=(128, 128), output=Path("holoeval-results", names[1]))
    assert [file.read_text() for file in files] == texts


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
