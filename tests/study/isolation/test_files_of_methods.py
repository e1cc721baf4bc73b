"""Files that a method reads are part of a cell's identity, and phases that were saved score what they scored."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from holobench_eval.core.errors import UserError
from holobench_eval.study.plan import Plan
from tests.study.studies import TWO, compute, planned, write_study

IDEAL = "{profiles: [ideal], panel: [128, 128]}"
AGED = "{profiles: [leto-aged], panel: [128, 128]}"


def config(folder: Path, name: str, methods: str) -> Path:
    return write_study(folder / f"{name}.yaml", methods, display=AGED, targets=TWO, save="{phases: true}")


def scores(records: list[dict[str, Any]], label: str) -> list[tuple[str, dict[str, float]]]:
    return sorted((record["cell"]["target"], record["scores"]) for record in records if record["label"] == label)


@pytest.mark.slow
def test_saved_phases_score_what_they_scored_and_are_saved_byte_for_byte(tmp_path):
    made = compute(config(tmp_path, "made", "double_phase"), tmp_path / "made").records
    saved = tmp_path / "made" / "phases" / "double_phase" / "leto-aged"
    read = f'{{name: phases, label: read, params: {{file: "{saved}/{{target}}.npy"}}}}'
    levels = f'{{name: phases, label: levels, params: {{file: "{saved}/{{target}}.png"}}}}'
    again = compute(config(tmp_path, "read", f"{read}, {levels}"), tmp_path / "read").records
    assert scores(again, "read") == scores(made, "double_phase")
    assert scores(again, "levels") == scores(made, "double_phase")  # 8 bits are what this panel shows
    untimed = {record["label"] for record in made + again if record["seconds"] is None}
    assert untimed & {"read", "levels", "double_phase"} == {"read", "levels"}
    for file in saved.iterdir():
        assert (tmp_path / "read" / "phases" / "read" / "leto-aged" / file.name).read_bytes() == file.read_bytes()


def ids(grid: Plan) -> dict[str, str]:
    return {cell.target: cell.id for label, cell in grid.labelled() if label == "phases"}


def test_another_file_is_another_cell_of_its_target_alone(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = config(tmp_path, "files", '{name: phases, params: {file: "{target}.npy"}}')
    with pytest.raises(UserError, match=r"none of the files that it reads is there, such as astronaut\.npy"):
        planned(path)
    np.save(tmp_path / "astronaut.npy", np.zeros((3, 128, 128)))
    cells = [cell for label, cell in planned(path).labelled() if label == "phases"]
    assert [cell.files[f"{cell.target}.npy"] == "absent" for cell in cells] == [False, True]
    names = [cell.target for cell in cells]
    for name in names:
        np.save(tmp_path / f"{name}.npy", np.zeros((3, 128, 128)))
    before = ids(planned(path))
    assert ids(planned(path)) == before
    np.save(tmp_path / f"{names[1]}.npy", np.ones((3, 128, 128)))
    after = ids(planned(path))
    assert [after[name] == before[name] for name in names] == [True, False]


@pytest.fixture
def pictures(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("pictures").mkdir()
    for seed, name in enumerate(("a.jpg", "a.png", "red cup.png")):
        pixels = np.random.default_rng(seed).integers(0, 256, (16, 16, 3)).astype(np.uint8)
        Image.fromarray(pixels).save(Path("pictures", name))
    np.save("a.npy", np.zeros((3, 128, 128)))
    return Path("pictures")


def named(pictures: Path, file: str, amplitude: str = "") -> Path:
    method = f'{{name: phases, params: {{file: "{file}", amplitude: "{amplitude}"}}}}'
    folder = "{dataset: folder, params: {path: pictures}}"
    return write_study(pictures.parent / "names.yaml", method, display=IDEAL, targets=folder)


@pytest.mark.parametrize("files", [("{stem}.npy",), ("{target}.npy", "{stem}.npy"), ("{stem}-{channel}.npy",)])
def test_two_targets_with_the_same_file_are_refused_by_the_plan(pictures, files):
    message = r"method 'phases': '\{stem\}.*\.npy' is the same file, a.*\.npy, for the targets 'a\.jpg' and 'a\.png'; "
    with pytest.raises(UserError, match=f"^{message}.*$"):
        planned(named(pictures, *files))
    (pictures / "a.jpg").unlink()
    assert len(ids(planned(named(pictures, "{stem}.npy")))) == 2


def test_one_file_for_all_targets_is_no_mistake_and_a_target_with_an_altered_name_is_named(pictures):
    assert len(set(ids(planned(named(pictures, "a.npy"))).values())) == 3
    for name in ("a.jpg", "a.png"):
        (pictures / name).unlink()
    message = r"is there, such as p/red_cup\.npy for the target 'red cup\.png', from the working directory"
    with pytest.raises(UserError, match=message):
        planned(named(pictures, "p/{stem}.npy"))


METHOD = """
import numpy as np
import torch


def mine(target, bench):
    return torch.from_numpy(np.load("mine.npy")).float().expand(len(target), -1, -1, -1)


mine.files = lambda target_name: ["mine.npy"]
"""


def test_a_file_that_a_method_says_it_reads_and_that_changed_after_planning_is_refused(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "method.py").write_text(METHOD)
    path = config(tmp_path, "files", '"method.py:mine"')
    np.save(tmp_path / "mine.npy", np.zeros((3, 128, 128)))
    grid = planned(path)
    (digest,) = {cell.files["mine.npy"] for label, cell in grid.labelled() if label == "mine"}
    assert digest != "absent"
    assert {record["state"] for record in compute(path, tmp_path / "out", grid=grid).records} == {"done"}
    np.save(tmp_path / "mine.npy", np.ones((3, 128, 128)))
    found = compute(path, tmp_path / "other", grid=grid).records
    (reason,) = {record["reason"] for record in found if record["label"] == "mine"}
    assert "has changed since the study was planned" in reason
