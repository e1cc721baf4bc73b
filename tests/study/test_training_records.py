import json
import math

import pytest
from rich.console import Console

from holobench_eval.commands.plan import training_table, trainings
from holobench_eval.core.io import write_atomically
from holobench_eval.report import layout_of
from holobench_eval.study.artifacts import FAILURE, Artifacts, training_records
from holobench_eval.study.config import load_study
from holobench_eval.study.plan import plan
from holobench_eval.study.training import keep_training_records

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
    assert layout_of(plain).training is None


def test_a_layout_knows_who_is_trained_and_on_how_many_images(study):
    layout = layout_of(study)
    assert layout.trained == {"A b", "a-b"}
    assert layout.training is not None
    assert (layout.training.images, layout.training.held_out, layout.training.captures) == (3, 1, 9)


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
    console = Console(width=80, record=True, file=open("/dev/null", "w"))  # noqa: PTH123, SIM115
    console.print(training_table([done, failed]))
    text = console.export_text()
    assert max(map(len, text.splitlines())) <= 80
    assert "failed: [no]" in text
    assert done.name.rpartition("-")[0] in text
    assert "61 s" in text


def test_a_preview_of_a_learned_display_names_the_display(study, artifacts, tmp_path):
    display = 'display: {learned: {method: "learner.py:Learner", profile: ideal}, panel: [128, 128]}'
    text = CONFIG.replace("display: {profiles: [ideal], panel: [128, 128]}", display)
    (tmp_path / "on.yaml").write_text(text)
    grid = plan(load_study(tmp_path / "on.yaml"))
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
