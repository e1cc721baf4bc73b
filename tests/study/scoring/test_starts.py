"""A method that follows the others of its study: its plan, its starts, and what is computed again."""

import shutil
from dataclasses import replace
from pathlib import Path
from threading import Timer
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

import pytest
import torch

from holobench_eval.core.errors import CellError, UserError
from holobench_eval.study import cost
from holobench_eval.study import store as storing
from holobench_eval.study.config import load_study
from holobench_eval.study.executors import Local
from holobench_eval.study.phases import phases_of, start_of
from holobench_eval.study.plan import Cell, Plan
from holobench_eval.study.running import run as running
from holobench_eval.study.scoring import starts
from holobench_eval.study.store import Store
from tests.study import studies
from tests.study.studies import add_other_profile, planned
from tests.support.patience import PATIENCE, killed_at
from tests.support.studies.fake_study import fake_work, held, installed, solves, untimed, write_config

pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("no_physics")]

POOR = '{name: "plugins.py:Toy", label: poor, params: {value: 1}}'
GOOD = POOR.replace("poor", "good").replace("1", "5")
FOLLOWING = '{name: "plugins.py:Following", label: oracle}'
FAILING = '{name: "plugins.py:Toy", label: good, params: {value: 5, fail: "no light"}}'
TARGETS = ("gray 0", "gray 1")


def cells(grid: Plan, label: str) -> list[Cell]:
    return [cell for name, cell in grid.labelled() if name == label]


def compute(config: Path, **options: Any) -> list[dict[str, Any]]:
    """The records of a study whose results are in the folder ``out`` beside its config."""
    return studies.compute(config, config.parent / "out", **options).records


def score(records: list[dict[str, Any]], label: str, target: str) -> float:
    (record,) = (one for one in records if (one["label"], one["cell"]["target"]) == (label, target))
    return float(record["scores"]["psnr_linear"])


@pytest.fixture(scope="module")
def computed(tmp_path_factory):
    """The folder of a computed study, which no test changes."""
    folder = tmp_path_factory.mktemp("computed")
    with installed():
        compute(write_config(folder, (FOLLOWING, POOR, GOOD), count=len(TARGETS)))
    return folder


@pytest.fixture(scope="module")
def grid(computed):
    return planned(computed / "study.yaml")


@pytest.fixture
def done(computed, tmp_path):
    """The config of that study in a folder of its own."""
    shutil.copytree(computed, tmp_path, dirs_exist_ok=True)
    return tmp_path / "study.yaml"


@pytest.fixture
def store(tmp_path):
    return Store(tmp_path / "out")


def test_a_cell_starts_from_those_of_all_others_for_its_target_display_and_repeat(tmp_path):
    add_other_profile(tmp_path)
    config = write_config(tmp_path, (FOLLOWING, POOR, GOOD), profiles="ideal, other.yaml", count=2)
    config.write_text(f"{config.read_text()}repeats: 2\n")
    grid = planned(config)
    by_id = {cell.id: cell for cell in grid.cells}
    for cell in cells(grid, "oracle"):
        others = [by_id[identity] for identity in cell.starts]
        for one in others:
            assert (one.target, one.condition, one.repeat) == (cell.target, cell.condition, cell.repeat)
        assert sorted(one.params["value"] for one in others) == [1, 5]
        assert set(cell.phase["starts"]) == {one.phase_id for one in others}


def test_its_identity_is_that_of_its_starts_whatever_their_order_and_theirs_knows_nothing_of_it(tmp_path):
    studies = (POOR, GOOD, FOLLOWING), (FOLLOWING, GOOD, POOR), (POOR, FOLLOWING), (POOR, GOOD)
    both, turned, fewer, without = (planned(write_config(tmp_path, methods, count=1)) for methods in studies)
    assert {cell.id for cell in both.cells} == {cell.id for cell in turned.cells}
    assert {cell.id for cell in cells(both, "oracle")}.isdisjoint(cell.id for cell in cells(fewer, "oracle"))
    assert {cell.id for cell in without.cells} < {cell.id for cell in both.cells}


def test_several_workers_pick_up_the_better_phase_of_another_method_as_one_process_does(done, store, grid, monkeypatch):
    serial = store.load(grid)
    for target in TARGETS:
        assert score(serial, "oracle", target) == pytest.approx(score(serial, "good", target), abs=1e-3)
        assert score(serial, "oracle", target) > score(serial, "poor", target) + 0.01
    shutil.rmtree(store.output)
    done.write_text(f"{done.read_text()}timing: alone\n")
    monkeypatch.setattr(running, "step", fake_work)
    local = compute(done, executor=Local(2))
    assert [{**one, "alone": None} for one in untimed(local)] == [{**one, "alone": None} for one in untimed(serial)]


def test_a_failed_start_is_no_start_and_once_it_is_there_the_cell_is_computed_again(tmp_path):
    config = write_config(tmp_path, (FOLLOWING, POOR, FAILING), count=2)
    first = compute(config)
    assert [one["label"] for one in first if one["state"] == "failed"] == ["good"]
    assert score(first, "oracle", "gray 1") == pytest.approx(score(first, "poor", "gray 1"), abs=2e-3)
    assert score(first, "oracle", "gray 0") > score(first, "poor", "gray 0") + 0.01
    phases = phases_of(tmp_path / "out")
    kept = [phases.path(cell.phase_id).exists() for cell in cells(planned(config), "oracle")]
    assert kept == [True, False]  # a phase from fewer starts than its name says is none
    before = len(solves(tmp_path))
    compute(config)
    assert len(solves(tmp_path)) == before
    compute(config, retry_failed=True)
    assert [line.split()[0] for line in solves(tmp_path)[before:]] == ["Toy", "Following"]


@pytest.mark.parametrize("lost", [False, True])
def test_a_start_is_solved_again_only_where_its_phase_was_lost_and_gives_the_same_record(done, store, grid, lost):
    solved = len(solves(done.parent))
    alone = untimed([one for one in store.load(grid) if one["label"] != "oracle"])
    followers = cells(grid, "oracle")
    store.remove(cell.id for cell in followers)  # as of a study without them
    phases_of(store.output).remove(cell.phase_id for cell in (grid.cells if lost else followers))
    together = compute(done)
    assert len(solves(done.parent)) - solved == (6 if lost else 2)
    assert untimed([one for one in together if one["label"] != "oracle"]) == alone


def test_a_cell_whose_start_has_to_be_computed_loses_its_record_first(done, store, grid, monkeypatch):
    first, follower = cells(grid, "poor")[0], cells(grid, "oracle")[0]
    store.path(first.id).unlink()
    states = store.states(grid.cells)
    found = starts.affected(grid, frozenset({first.id}), states, phases_of(store.output))
    assert found == ({first.id, follower.id}, {follower.id})
    monkeypatch.setattr(running, "_compute", lambda *_: 0)  # as if it were killed at once
    compute(done)
    assert not store.path(follower.id).exists()


def test_starts_that_are_only_timed_again_leave_their_followers_alone(done, store, grid):
    for cell in grid.cells:
        if (record := store.read(cell.id)) is not None and record.alone:
            store.write(replace(record, alone=False))
    timed = cost.timed(replace(load_study(done), timing="alone"), grid)
    states, phases = store.states(grid.cells, timed), phases_of(store.output)
    again = frozenset(name for name, state in states.items() if state == "untimed")
    assert len(again) == 3  # of each method the last target
    assert starts.affected(grid, again, states, phases) == (again, frozenset())
    others = again - {cell.id for cell in cells(grid, "oracle")}
    assert starts.affected(grid, others, states, phases) == (others, frozenset())


@pytest.mark.parametrize("refusal", ["refuse_unscored", "refuse_unavailable"])
def test_a_run_that_is_refused_removes_no_record(done, store, grid, refusal, monkeypatch):
    store.remove((cells(grid, "poor")[0].id,))
    before = store.states(grid.cells)
    monkeypatch.setattr(running, refusal, Mock(side_effect=UserError("not here")))
    with pytest.raises(UserError, match="not here"):
        compute(done)
    assert store.states(grid.cells) == before


def record_file(store: Store, cell: Cell) -> Path:
    return store.path(cell.id)


def phase_file(store: Store, cell: Cell) -> Path:
    return phases_of(store.output).path(cell.phase_id)


def starts_of(store: Store, cell: Cell) -> list[torch.Tensor]:
    job: Any = SimpleNamespace(store=store, phases=phases_of(store.output))
    return starts.of(job, cell)


@pytest.mark.usefixtures("done")
@pytest.mark.parametrize("file", [record_file, phase_file])
def test_a_start_that_another_machine_has_just_written_is_waited_for_until_it_is_late(store, grid, file, monkeypatch):
    follower, late = cells(grid, "oracle")[0], file(store, cells(grid, "good")[0])
    before = starts_of(store, follower)
    hidden = late.rename(late.with_name("hidden"))
    writer = Timer(0.3, hidden.rename, (late,))
    writer.start()
    after = starts_of(store, follower)
    writer.join(PATIENCE)
    assert torch.equal(torch.stack(after), torch.stack(before))
    monkeypatch.setattr(storing, "LATE", 0.0)
    late.unlink()
    with pytest.raises(CellError, match="of a method to start from is not there"):
        starts_of(store, follower)


def other_file(store: Store, cell: Cell) -> str:
    phases = phases_of(store.output)
    known = phases.read(cell.phase_id, None)
    assert known is not None
    phases.keep(cell.phase_id, replace(known, covered={"data.txt": "0" * 64}))
    return "was solved with another data.txt than is there now; run again"


def damaged(store: Store, cell: Cell) -> str:
    file = phase_file(store, cell)
    file.write_bytes(file.read_bytes()[:-100])
    return "is damaged; delete the file and run again"


@pytest.mark.parametrize("change", [damaged, other_file])
def test_a_start_that_is_not_as_it_was_kept_is_an_error_with_its_reason_and_the_next_run_solves_it(
    done, store, grid, change
):
    follower, solved = cells(grid, "oracle")[0], len(solves(done.parent))
    reason = change(store, cells(grid, "good")[0])
    with pytest.raises(CellError, match=rf"\.pt, from which this method starts, {reason}"):
        starts_of(store, follower)
    store.remove([follower.id])
    compute(done)
    assert [line.split()[0] for line in solves(done.parent)[solved:]] == ["Toy"]


def test_a_start_is_the_phase_that_was_shown_to_a_tenth_of_a_milliradian():
    phase = torch.linspace(-9, 9, 2 * 5 * 7).view(2, 5, 7)
    start = start_of(phase)
    assert float((torch.exp(1j * start) - torch.exp(1j * phase)).abs().max()) < 1e-4


def test_a_run_killed_before_and_at_the_followers_gives_the_same_records(computed, grid, tmp_path):
    config = write_config(tmp_path, (FOLLOWING, POOR, GOOD), count=len(TARGETS))
    for index, begun in ((1, 3), (0, 6)):  # while a start is solved, and while the first follower is
        with held(tmp_path, index):
            killed_at(lambda: len(solves(tmp_path)) >= begun, studies.compute_faked, config, tmp_path / "out")  # noqa: B023
    whole = Store(computed / "out").load(grid)
    assert untimed(compute(config)) == untimed(whole)


def test_a_phase_that_began_with_another_of_the_same_name_is_not_used(done, store, grid):
    phases, solved = phases_of(store.output), len(solves(done.parent))
    follower = cells(grid, "oracle")[0]
    for other in grid.cells:  # as another training leaves them
        if other.id in follower.starts:
            known = phases.read(other.phase_id)
            assert known is not None
            phases.keep(other.phase_id, replace(known, phase=known.phase + 1))
    store.remove([follower.id])
    compute(done)
    assert len(solves(done.parent)) == solved + 1
