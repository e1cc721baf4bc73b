from __future__ import annotations

import hashlib
import json
import os
import pickle
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import torch

from holobench_eval.core.errors import UserError
from holobench_eval.study.artifacts import LOG, PROVENANCE, STATE, Artifacts, FolderMemory, read_log
from tests.support.studies.trained_study import (
    artifact_of,
    assert_refused,
    compute,
    holoeval,
    needs,
    rounds,
    write,
)

pytestmark = pytest.mark.usefixtures("no_physics")


def test_an_artifact_says_what_it_was_made_for_and_is_made_once_for_all_studies_that_need_it(tmp_path):
    config = write(tmp_path)
    outcome = compute(config)
    assert outcome.failed == 0
    (needed,) = needs(config)
    artifact = Artifacts(tmp_path / "artifacts").load(needed)
    assert artifact.provenance["description"] == needed.description()
    assert artifact.provenance["captures"] == 2
    assert set(artifact.state) == {"gain", "last"}
    learned = {name: artifact.provenance[name] for name in ("sha256", "captures", "seconds")}
    assert outcome.records[-1]["learned"] == learned
    assert all(record["learned"] is None for record in outcome.records[:-1])
    assert {path.name for path in artifact_of(config).iterdir()} == {STATE, PROVENANCE, "training.csv", ".lock"}
    again = compute(write(tmp_path, ("count: 1", "count: 2")), "other")
    assert rounds(tmp_path) == [0, 1]
    assert again.records[-1]["learned"] == learned


@pytest.fixture(scope="module")
def needed(tmp_path_factory):
    """What a study has to learn."""
    (needed,) = needs(write(tmp_path_factory.mktemp("needed")))
    return needed


@pytest.mark.parametrize(
    ("spec", "version", "words"),
    [
        ({"shape": (128, 192)}, 1, "panel [128, 128], this study needs [128, 192]"),
        (
            {"wavelengths": (6.36e-7, 5.32e-7, 4.46e-7)},
            1,
            "wavelengths [6.36e-07, 5.17e-07, 4.46e-07], this study needs",
        ),
        ({}, 2, "profile version 1, this study needs 2"),
    ],
)
def test_an_artifact_that_was_learned_for_another_display_is_refused(tmp_path, needed, spec, version, words):
    display = replace(needed.display, version=version, spec=replace(needed.display.spec, **spec))
    other, artifacts = replace(needed, display=display), Artifacts(tmp_path)
    artifacts.write(needed, {}, {"captures": 2, "seconds": 0.5})
    artifacts.folder_of(needed).rename(artifacts.folder_of(other))
    with pytest.raises(UserError, match=re.escape(f"{artifacts.folder_of(other)}: trained for {words}")):
        artifacts.load(other)


class Code:
    """A pickle that would make a file."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[Any, ...]:
        return os.mkdir, (str(self.path),)


def truncated(place: Path) -> None:
    content = (place / STATE).read_bytes()
    (place / STATE).write_bytes(content[: len(content) // 2])


def with_code(place: Path) -> None:
    (place / STATE).write_bytes(pickle.dumps({"format": 1, "state": Code(place / "entered")}, protocol=2))


def with_code_saved_by_torch(place: Path) -> None:
    torch.save({"format": 1, "state": Code(place / "entered")}, place / STATE)


def another_state(place: Path) -> None:
    content = torch.load(place / STATE, weights_only=True)
    content["state"]["gain"] += 1
    torch.save(content, place / STATE)


def gone(place: Path) -> None:
    (place / STATE).unlink()


def no_state(place: Path) -> None:
    torch.save({"format": 1}, place / STATE)
    edit(place, sha256=hashlib.sha256((place / STATE).read_bytes()).hexdigest())


def edit(place: Path, **values: Any) -> None:
    """Exchange entries of the provenance; None removes one."""
    known = json.loads((place / PROVENANCE).read_text()) | values
    (place / PROVENANCE).write_text(json.dumps({key: value for key, value in known.items() if value is not None}))


def edited_description(place: Path) -> None:
    known = json.loads((place / PROVENANCE).read_text())["description"]
    edit(place, description=known | {"seed": 4})


def values(**changes: Any) -> Callable[[Path], None]:
    return lambda place: edit(place, **changes)


def content(name: str, text: bytes) -> Callable[[Path], Any]:
    return lambda place: (place / name).write_bytes(text)


DAMAGES: list[tuple[Callable[[Path], Any], str]] = [
    (truncated, "damaged, or not a file of tensors"),
    (content(STATE, b""), "damaged, or not a file of tensors"),
    (with_code, "damaged, or not a file of tensors"),
    (with_code_saved_by_torch, "damaged, or not a file of tensors"),
    (another_state, "is not the file that provenance.json describes"),
    (gone, "learned.pt or provenance.json is missing"),
    (no_state, "of another version"),
    (edited_description, "trained for seed 4, this study needs 3"),
    (values(description={}), "trained for method null"),
    (values(sha256="0" * 64), "is not the file"),
    (content(LOG, b"round\n1\n"), "training.csv: is not the file that provenance.json"),
    (values(format=None), "of another version"),
    (values(format=2), "of another version"),
    *((values(**{key: None}), f"no valid '{key}'") for key in ("description", "sha256", "log_sha256", "captures")),
    (values(captures="few"), "no valid 'captures'"),
    (values(seconds=None), "no valid 'seconds'"),
    *(
        (content(PROVENANCE, text), "not an artifact's provenance")
        for text in (b"{", b"[1]", b"[" * 100_000, b"\xff\xfe{")
    ),
]


@pytest.mark.parametrize(("damage", "words"), DAMAGES)
def test_a_damaged_or_hostile_artifact_is_refused_in_one_line(tmp_path, needed, damage, words):
    artifacts = Artifacts(tmp_path / "artifacts")
    artifacts.write(needed, {"gain": torch.ones(3)}, {"captures": 2, "seconds": 0.5})
    assert artifacts.load(needed).state["gain"].tolist() == [1, 1, 1]
    place = artifacts.folder_of(needed)
    damage(place)
    with pytest.raises(UserError) as refused:
        artifacts.load(needed)
    assert str(refused.value).startswith(str(place))
    assert words in str(refused.value)
    assert "\n" not in str(refused.value)
    assert not (place / "entered").exists()


def test_a_run_with_a_hostile_artifact_ends_with_one_line_and_exit_code_2_unless_it_trains_again(
    tmp_path, monkeypatch, capsys
):
    compute(write(tmp_path))
    other = write(tmp_path, ("count: 1", "count: 2"))
    place = artifact_of(other)
    with_code(place)
    capsys.readouterr()
    assert_refused(holoeval(monkeypatch, other), capsys.readouterr(), str(place), "run again")
    assert not (place / "entered").exists()
    assert rounds(tmp_path) == [0, 1]
    assert holoeval(monkeypatch, other, "--retrain") == 0


def test_an_unfinished_value_that_is_damaged_is_refused(tmp_path):
    memory = FolderMemory(tmp_path)
    memory.save("a value", {"a": torch.ones(2)})
    assert torch.equal(memory.load("a value")["a"], torch.ones(2))  # type: ignore[index]
    assert memory.load("another") is None
    (path,) = (tmp_path / "unfinished").glob("*.pt")
    path.write_bytes(path.read_bytes()[:40])
    with pytest.raises(UserError, match="damaged, or not a file of tensors"):
        memory.load("a value")


def test_values_of_any_name_stay_in_their_folder(tmp_path):
    memory = FolderMemory(tmp_path / "one")
    for name in ("../../up", "/absolute", "a/b", "a_b", ""):
        memory.save(name, {"name": name})
    assert [memory.load(name) for name in ("../../up", "a/b", "a_b", "")] == [
        {"name": name} for name in ("../../up", "a/b", "a_b", "")
    ]
    assert len(list((tmp_path / "one" / "unfinished").iterdir())) == 5
    assert [path.name for path in tmp_path.iterdir()] == ["one"]


def test_an_artifact_whose_training_read_another_file_is_made_again(tmp_path):
    (needed,) = needs(write(tmp_path))
    artifacts, weights = Artifacts(tmp_path / "artifacts"), tmp_path / "weights.bin"
    weights.write_bytes(b"1")
    reads = {"weights.bin": hashlib.sha256(b"1").hexdigest()}
    artifacts.write(needed, {}, {"captures": 2, "seconds": 0.5, "reads": reads})
    assert artifacts.has(needed)
    weights.write_bytes(b"2")
    assert not artifacts.has(needed)


def test_a_logged_row_is_merged_with_an_older_one_of_its_round_and_step(tmp_path):
    memory = FolderMemory(tmp_path)
    for row in ({"round": 1, "step": 10, "l1": 0.5}, {"round": 1, "fidelity": 20.0}, {"note": "x"}, {"note": "y"}):
        memory.log(row)
    for again in ({"round": 1, "step": 10, "l1": 0.25}, {"round": 1, "fidelity": 21.0}):
        memory.log(again)
    rows = [{key: value for key, value in row.items() if value} for row in read_log(tmp_path)]
    merged = [{"round": "1", "step": "10", "l1": "0.25"}, {"round": "1", "fidelity": "21"}]
    assert rows == [*merged, {"note": "x"}, {"note": "y"}]
