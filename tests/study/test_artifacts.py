import hashlib
import io
import json
import math
import os
import pickle
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import torch
from rich.console import Console

from holobench_eval.commands.plan import training_table, trainings
from holobench_eval.core.errors import UserError
from holobench_eval.core.io import write_atomically
from holobench_eval.report import facts_of
from holobench_eval.study.artifacts import (
    FAILURE,
    LOG,
    PROVENANCE,
    STATE,
    Artifacts,
    FolderMemory,
    read_log,
    training_records,
)
from holobench_eval.study.config import load_study
from holobench_eval.study.plan import plan
from holobench_eval.study.training import keep_training_records
from tests.study.studies import one_line, planned
from tests.support.studies.trained_study import artifact_of, assert_refused, compute, holoeval, needs, rounds
from tests.support.studies.trained_study import write_inside as write

pytestmark = pytest.mark.usefixtures("no_physics")


def test_an_artifact_says_what_it_was_made_for_and_is_made_once_for_all_studies_that_need_it(tmp_path):
    config, lines = write(tmp_path), list[str]()
    outcome = compute(config, write=lines.append)
    assert outcome.failed == 0
    (needed,) = needs(config)
    assert lines[1:3] == [f"1 to train: {needed.name}", f"trained: {needed.name}"]
    artifact = Artifacts(tmp_path / "artifacts").load(needed)
    assert artifact.provenance["description"] == needed.description()
    assert artifact.provenance["captures"] == 2
    assert set(artifact.state) == {"gain", "last"}
    learned = {name: artifact.provenance[name] for name in ("sha256", "captures", "seconds")}
    assert outcome.records[-1]["learned"] == learned
    assert all(record["learned"] is None for record in outcome.records[:-1])
    assert {path.name for path in artifact_of(config).iterdir()} == {STATE, PROVENANCE, "training.csv", ".lock"}
    lines.clear()
    again = compute(write(tmp_path, ("count: 1", "count: 2")), "other", lines.append)
    assert rounds(tmp_path) == [0, 1]
    assert not any("train" in line for line in lines)
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
        ({"wavelengths": (6.36e-7, 5.32e-7, 4.46e-7)}, 1, "wavelengths [6.36e-07, 5.17e-07, 4.46e-07], this"),
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


def with_code(place: Path) -> None:
    (place / STATE).write_bytes(pickle.dumps({"format": 1, "state": Code(place / "entered")}, protocol=2))


def another_state(place: Path) -> None:
    content = torch.load(place / STATE, weights_only=True)
    content["state"]["gain"] += 1
    torch.save(content, place / STATE)


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
    (
        lambda place: (place / STATE).write_bytes((place / STATE).read_bytes()[:300]),
        "damaged, or not a file of tensors",
    ),
    (content(STATE, b""), "damaged, or not a file of tensors"),
    (with_code, "damaged, or not a file of tensors"),
    (lambda place: torch.save({"state": Code(place / "entered")}, place / STATE), "damaged, or not a file of tensors"),
    (another_state, "is not the file that provenance.json describes"),
    (lambda place: (place / STATE).unlink(), "learned.pt or provenance.json is missing"),
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
    with one_line(words, at=str(place)):
        artifacts.load(needed)
    assert not (place / "entered").exists()


def test_a_run_with_a_hostile_artifact_ends_with_one_line_unless_it_trains_again(tmp_path, monkeypatch, capsys):
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


METHOD = """
from dataclasses import dataclass
from typing import ClassVar

@dataclass(frozen=True)
class Learner:
    width: int = 4
    trains: ClassVar[bool] = True
    def prepare(self, bench):
        return {}
    def solve(self, target, bench):
        return target
    def predict(self, phase, bench):
        return phase
"""
CONFIG = """
title: Learners
display: {profiles: [ideal], panel: [128, 128]}
targets: {dataset: charts}
training: {dataset: dead_leaves, params: {count: 3}, held_out: 1, captures: 9}
methods:
  - {name: "learner.py:Learner", label: A b}
  - {name: "learner.py:Learner", label: a-b, params: {width: 8}}
  - wirtinger
"""
LOG = "round,step,captures,seconds,fidelity_psnr\n1,10,5,2.5,14.5\n"


@pytest.fixture
def study(tmp_path):
    (tmp_path / "learner.py").write_text(METHOD)
    (tmp_path / "study.yaml").write_text(CONFIG)
    return load_study(tmp_path / "study.yaml")


@pytest.fixture
def artifacts(tmp_path):
    return Artifacts(tmp_path / "artifacts")


def finish(artifacts, needed, captures=7):
    write_atomically(artifacts.folder_of(needed) / "training.csv", LOG.encode())
    artifacts.write(needed, {}, {"captures": captures, "seconds": 61.25})


def test_logs_and_provenance_are_kept_beside_the_report_while_they_are_needed(study, artifacts, tmp_path):
    grid, output = plan(study), tmp_path / "out"
    first, second = grid.preparations().values()
    for needed in (first, second):
        finish(artifacts, needed)
    keep_training_records(grid, artifacts, output)
    names = sorted(path.name for path in (output / "training").iterdir())
    other = f"a-b-ideal-{second.id[:8]}"
    assert names == ["A-b-ideal.csv", "A-b-ideal.json", f"{other}.csv", f"{other}.json"]
    found = training_records(output)
    assert set(found) == {first.id, second.id}
    assert found[first.id].provenance["captures"] == 7
    assert [(one.captures, one.fidelity) for one in found[first.id].rounds] == [(5, 14.5)]
    stale = output / "training" / "of-an-earlier-config.csv"
    stale.write_text(LOG)
    artifacts.remove(first)
    keep_training_records(grid, artifacts, output)
    assert not stale.exists()
    assert set(training_records(output)) == {first.id, second.id}  # what is kept outlives its artifact


def test_a_study_that_trains_nothing_gets_no_folder(study, artifacts, tmp_path):
    (tmp_path / "plain.yaml").write_text(CONFIG.split("methods:")[0] + "methods: [wirtinger]\n")
    plain = load_study(tmp_path / "plain.yaml")
    keep_training_records(plan(plain), artifacts, tmp_path / "out")
    assert not (tmp_path / "out").exists()
    assert trainings(plan(plain), artifacts) == []
    assert facts_of(plain).training is None


def test_facts_know_who_is_trained_and_on_how_many_images(study):
    facts = facts_of(study)
    told = facts.training
    assert (facts.labels("trained"), told.images, told.held_out, told.captures) == ({"A b", "a-b"}, 3, 1, 9)


def test_a_preview_says_what_is_trained_unfinished_failed_and_missing(study, artifacts):
    grid = plan(study)
    first, second = grid.preparations().values()
    before = trainings(grid, artifacts)
    assert [(row.state, row.needed_by) for row in before] == [("missing", ("A b",)), ("missing", ("a-b",))]
    assert math.isnan(before[0].captures)

    write_atomically(artifacts.folder_of(second) / "training.csv", LOG.encode())
    artifacts.memory(second).save("network", {})
    finish(artifacts, first)
    done, unfinished = trainings(grid, artifacts)
    assert (done.state, done.captures, done.seconds) == ("done", 7, 61.25)
    assert (unfinished.state, unfinished.captures, unfinished.seconds) == ("unfinished", 5, 2.5)

    write_atomically(artifacts.folder_of(second) / FAILURE, b"[no] captures left\n")
    failed = trainings(grid, artifacts)[1]
    assert (failed.state, failed.reason) == ("failed", "[no] captures left")
    console = Console(width=80, file=io.StringIO())
    console.print(training_table([done, failed]))
    text = console.file.getvalue()
    assert max(map(len, text.splitlines())) <= 80
    assert all(words in text for words in ("failed: [no]", done.name.rpartition("-")[0], "61 s"))


def test_a_preview_of_a_learned_display_names_the_display(study, artifacts, tmp_path):
    display = 'display: {learned: {method: "learner.py:Learner", profile: ideal}, panel: [128, 128]}'
    text = CONFIG.replace("display: {profiles: [ideal], panel: [128, 128]}", display)
    (tmp_path / "on.yaml").write_text(text)
    grid = planned(tmp_path / "on.yaml")
    shared = next(row for row in trainings(grid, artifacts) if "A b" in row.needed_by)
    assert any(name.startswith("display ") for name in shared.needed_by)


def test_a_damaged_provenance_is_passed_over(study, artifacts, tmp_path):
    grid, output = plan(study), tmp_path / "out"
    first, _ = grid.preparations().values()
    finish(artifacts, first)
    for damaged in ("{", "[]", json.dumps({"description": 3})):
        (artifacts.folder_of(first) / "provenance.json").write_text(damaged)
        keep_training_records(grid, artifacts, output)
        assert training_records(output) == {}
        assert math.isnan(trainings(grid, artifacts)[0].captures)
