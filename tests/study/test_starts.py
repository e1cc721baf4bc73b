"""A method that follows the others of its study: its plan, its starts, and what is computed again."""

from __future__ import annotations

import signal
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from threading import Timer
from types import SimpleNamespace
from typing import Any

import pytest
import torch

from holobench_eval.core.errors import CellError, UserError
from holobench_eval.study import cost
from holobench_eval.study import run as running
from holobench_eval.study import store as storing
from holobench_eval.study.config import load_study
from holobench_eval.study.executors import Local, Serial
from holobench_eval.study.phases import phases_of, start_of
from holobench_eval.study.plan import Cell, Plan, plan
from holobench_eval.study.scoring import starts
from holobench_eval.study.store import Store
from tests.study.test_executors import compute, untimed
from tests.study.test_kill_and_resume import assert_tables_of_a_whole_run, start, wait_for, wait_for_solves
from tests.study.test_run import add_other_profile
from tests.support.fake_study import fake_work, solves, write_config

POOR, GOOD = (
    '{{name: "plugins.py:Toy", label: {}, params: {{value: {}}}}}'.format(*row) for row in (("poor", 1), ("good", 5))
)
FOLLOWING = '{name: "plugins.py:Following", label: oracle}'
FAILING = '{name: "plugins.py:Toy", label: good, params: {value: 5, fail: "no light"}}'


def planned(config: Path) -> Plan:
    return plan(load_study(config))


def cells(grid: Plan, label: str) -> list[Cell]:
    return [cell for name, cell in grid.labelled() if name == label]


def score(records: list[dict[str, Any]], label: str, target: str) -> float:
    (record,) = (one for one in records if (one["label"], one["cell"]["target"]) == (label, target))
    return float(record["scores"]["psnr_linear"])


def test_a_cell_starts_from_those_of_all_others_for_its_target_display_and_repeat(tmp_path: Path) -> None:
    add_other_profile(tmp_path)
    config = write_config(tmp_path, (FOLLOWING, POOR, GOOD), profiles="ideal, other.yaml", count=2)
    config.write_text(f"{config.read_text()}repeats: 2\n")
    grid = planned(config)
    by_id = {cell.id: cell for cell in grid.cells}
    for cell in cells(grid, "oracle"):
        others = [by_id[identity] for identity in cell.starts]
        assert {(one.target, one.condition, one.repeat) for one in others} == {
            (cell.target, cell.condition, cell.repeat)
        }
        assert sorted(one.params["value"] for one in others) == [1, 5]
        assert set(cell.phase["starts"]) == {one.phase_id for one in others}


def test_its_identity_is_that_of_its_starts_whatever_their_order_and_theirs_knows_nothing_of_it(tmp_path: Path) -> None:
    both = planned(write_config(tmp_path, (POOR, GOOD, FOLLOWING)))
    turned = planned(write_config(tmp_path, (FOLLOWING, GOOD, POOR)))
    fewer = planned(write_config(tmp_path, (POOR, FOLLOWING)))
    without = planned(write_config(tmp_path, (POOR, GOOD)))
    assert {cell.id for cell in both.cells} == {cell.id for cell in turned.cells}
    assert {cell.id for cell in cells(both, "oracle")}.isdisjoint(cell.id for cell in cells(fewer, "oracle"))
    assert {cell.id for cell in without.cells} < {cell.id for cell in both.cells}


@pytest.mark.usefixtures("no_physics")
def test_the_better_phase_of_another_method_is_picked_up(tmp_path: Path) -> None:
    records = compute(write_config(tmp_path, (FOLLOWING, POOR, GOOD)), tmp_path / "out", Serial())
    for target in ("gray 0", "gray 1", "gray 2"):
        assert score(records, "oracle", target) == pytest.approx(score(records, "good", target), abs=1e-3)
        assert score(records, "oracle", target) > score(records, "poor", target) + 0.01


@pytest.mark.slow
@pytest.mark.usefixtures("no_physics")
@pytest.mark.parametrize("timing", ["shared", "alone"])
def test_several_workers_give_what_one_process_gives(
    tmp_path: Path, timing: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    config = write_config(tmp_path, (FOLLOWING, POOR, GOOD))
    config.write_text(f"{config.read_text()}timing: {timing}\n")
    serial = compute(config, tmp_path / "serial", Serial())
    monkeypatch.setattr(running, "step", fake_work)
    assert untimed(compute(config, tmp_path / "local", Local(3))) == untimed(serial)


@pytest.mark.usefixtures("no_physics")
def test_a_failed_start_is_no_start_and_once_it_is_there_the_cell_is_computed_again(tmp_path: Path) -> None:
    config = write_config(tmp_path, (FOLLOWING, POOR, FAILING))
    first = compute(config, tmp_path / "out", Serial())
    assert [one["label"] for one in first if one["state"] == "failed"] == ["good"]
    assert score(first, "oracle", "gray 1") == pytest.approx(score(first, "poor", "gray 1"), abs=2e-3)
    assert score(first, "oracle", "gray 0") > score(first, "poor", "gray 0") + 0.01
    before = len(solves(tmp_path))
    compute(config, tmp_path / "out", Serial())
    assert len(solves(tmp_path)) == before
    compute(config, tmp_path / "out", Serial(), retry_failed=True)
    assert [line.split()[0] for line in solves(tmp_path)[before:]] == ["Toy", "Following"]


@pytest.mark.usefixtures("no_physics")
@pytest.mark.parametrize("lost", [False, True])
def test_a_start_is_solved_again_for_a_follower_only_where_its_phase_was_lost_and_gives_the_same_record(
    tmp_path: Path, lost: bool
) -> None:
    config = write_config(tmp_path, (POOR, GOOD))
    config.write_text(f"{config.read_text()}isolation: none\n")  # as with the follower
    alone = compute(config, tmp_path / "out", Serial())
    if lost:
        phases_of(tmp_path / "out").remove(cell.phase_id for cell in planned(config).cells)
    together = compute(write_config(tmp_path, (POOR, GOOD, FOLLOWING)), tmp_path / "out", Serial())
    assert len(solves(tmp_path)) == 6 + 3 + 6 * lost
    assert untimed([one for one in together if one["label"] != "oracle"]) == untimed(alone)
    compute(write_config(tmp_path, (POOR, GOOD, FOLLOWING)), tmp_path / "out", Serial())
    assert len(solves(tmp_path)) == 6 + 3 + 6 * lost


@pytest.mark.usefixtures("no_physics")
def test_a_phase_that_was_found_while_a_start_had_failed_is_not_kept(tmp_path: Path) -> None:
    config = write_config(tmp_path, (FOLLOWING, POOR, FAILING))
    compute(config, tmp_path / "out", Serial())
    phases = phases_of(tmp_path / "out")
    assert [phases.path(cell.phase_id).exists() for cell in cells(planned(config), "oracle")] == [True, False, True]


@pytest.mark.usefixtures("no_physics")
def test_a_cell_whose_start_has_to_be_computed_loses_its_record_before_anything_is_computed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    config, store = write_config(tmp_path, (POOR, FOLLOWING), count=2), Store(tmp_path / "out")
    compute(config, tmp_path / "out", Serial())
    grid = planned(config)
    first, follower = cells(grid, "poor")[0], cells(grid, "oracle")[0]
    store.path(first.id).unlink()
    states = store.states(grid.cells)
    phases = phases_of(store.output)
    assert starts.affected(grid, absent(states), states, phases) == ({first.id, follower.id}, {follower.id})
    monkeypatch.setattr(running, "_compute", lambda *_: 0)  # as if it were killed at once
    compute(config, tmp_path / "out", Serial())
    assert not store.path(follower.id).exists()


def absent(states: Mapping[str, str]) -> frozenset[str]:
    """The cells that have to be computed, or timed again."""
    return frozenset(name for name, state in states.items() if state in ("missing", "untimed"))


@pytest.fixture
def timed_again(tmp_path: Path) -> Path:
    """The config of a computed study whose timed cells have to be computed again, since they were not timed alone."""
    config, store = write_config(tmp_path, (POOR, GOOD, FOLLOWING)), Store(tmp_path / "out")
    compute(config, store.output, Serial())
    for cell in planned(config).cells:
        if (record := store.read(cell.id)) is not None and record.alone:
            store.write(replace(record, alone=False))
    config.write_text(f"{config.read_text()}timing: alone\n")
    return config


@pytest.mark.usefixtures("no_physics")
def test_starts_that_are_only_timed_again_leave_the_records_of_their_followers(
    tmp_path: Path, timed_again: Path
) -> None:
    store, grid = Store(tmp_path / "out"), planned(timed_again)
    states, phases = store.states(grid.cells, cost.timed(load_study(timed_again), grid)), phases_of(store.output)
    again = absent(states)
    assert len(again) == 3  # of each method the last target
    assert starts.affected(grid, again, states, phases) == (again, frozenset())
    others = again - {cell.id for cell in cells(grid, "oracle")}
    assert starts.affected(grid, others, states, phases) == (others, frozenset())


@pytest.mark.usefixtures("no_physics")
@pytest.mark.parametrize("refusal", ["refuse_unscored", "refuse_unavailable"])
def test_a_run_that_is_refused_removes_no_record(tmp_path: Path, refusal: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(*_: Any) -> None:
        raise UserError("not here")

    config, store = write_config(tmp_path, (POOR, GOOD, FOLLOWING)), Store(tmp_path / "out")
    compute(config, store.output, Serial())
    grid = planned(config)
    store.remove((cells(grid, "poor")[0].id,))
    before = store.states(grid.cells)
    monkeypatch.setattr(running, refusal, refused)
    with pytest.raises(UserError, match="not here"):
        compute(config, store.output, Serial())
    assert store.states(grid.cells) == before


@pytest.mark.usefixtures("no_physics")
def test_a_follower_that_fails_while_it_is_timed_again_keeps_its_score(
    tmp_path: Path, timed_again: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: Any) -> None:
        raise CellError("no light")

    store, grid = Store(tmp_path / "out"), planned(timed_again)
    before = store.states(grid.cells)
    monkeypatch.setattr(starts, "of", fail)
    compute(timed_again, store.output, Serial())
    assert store.states(grid.cells) == before


def record_file(store: Store, cell: Cell) -> Path:
    return store.path(cell.id)


def phase_file(store: Store, cell: Cell) -> Path:
    return phases_of(store.output).path(cell.phase_id)


def job_of(store: Store) -> Any:
    """What ``starts.of`` needs of a job."""
    return SimpleNamespace(store=store, phases=phases_of(store.output))


@pytest.mark.usefixtures("no_physics")
@pytest.mark.parametrize("file", [record_file, phase_file])
def test_a_start_that_another_machine_has_just_written_is_waited_for(tmp_path: Path, file: Callable[..., Path]) -> None:
    grid, store = solved(tmp_path)
    (follower,), late = cells(grid, "oracle"), file(store, cells(grid, "good")[0])
    before = starts.of(job_of(store), follower)
    hidden = late.rename(tmp_path / "hidden")
    writer = Timer(0.3, hidden.rename, (late,))
    writer.start()
    after = starts.of(job_of(store), follower)
    writer.join()
    assert torch.equal(torch.stack(after), torch.stack(before))


@pytest.mark.usefixtures("no_physics")
@pytest.mark.parametrize("file", [record_file, phase_file])
def test_a_start_that_does_not_appear_is_an_error(
    tmp_path: Path, file: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    grid, store = solved(tmp_path)
    (follower,) = cells(grid, "oracle")
    monkeypatch.setattr(storing, "LATE", 0.0)
    file(store, cells(grid, "good")[0]).unlink()
    with pytest.raises(CellError, match="of a method to start from is not there"):
        starts.of(job_of(store), follower)


@pytest.mark.usefixtures("no_physics")
def test_a_start_in_a_damaged_file_is_an_error(tmp_path: Path) -> None:
    grid, store = solved(tmp_path)
    file = phase_file(store, cells(grid, "good")[0])
    file.write_bytes(file.read_bytes()[:-100])
    with pytest.raises(CellError, match=r"\.pt, from which this method starts, is damaged; delete the file"):
        starts.of(job_of(store), cells(grid, "oracle")[0])


def solved(folder: Path) -> tuple[Plan, Store]:
    """A computed study of one target."""
    config, store = write_config(folder, (POOR, GOOD, FOLLOWING), count=1), Store(folder / "out")
    compute(config, store.output, Serial())
    return planned(config), store


def test_a_start_is_the_phase_that_was_shown_to_a_tenth_of_a_milliradian() -> None:
    phase = torch.linspace(-9, 9, 2 * 5 * 7).view(2, 5, 7)
    start = start_of(phase)
    assert float((torch.exp(1j * start) - torch.exp(1j * phase)).abs().max()) < 1e-4


@pytest.mark.slow
@pytest.mark.usefixtures("no_physics")
def test_a_run_that_was_killed_before_the_followers_gives_the_bytes_of_one_that_was_not(tmp_path: Path) -> None:
    methods = (*(row.replace("value:", "pause: 0.3, value:") for row in (POOR, GOOD)), FOLLOWING)
    config, output = write_config(tmp_path, methods), tmp_path / "out"
    for solved in (3, 7):
        killed = start(config, output)
        wait_for_solves(tmp_path, solved, killed)
        killed.kill()
        assert wait_for(killed)[0] == -signal.SIGKILL
    code, _, err = wait_for(start(config, output))
    assert (code, err) == (0, "")
    assert_tables_of_a_whole_run(config, output)


def test_a_phase_that_began_with_another_phase_of_the_same_name_is_not_used(tmp_path: Path) -> None:
    config = write_config(tmp_path, (POOR, GOOD, FOLLOWING))
    compute(config, tmp_path / "out", Serial())
    (follower, *_), solved = [cell for cell in planned(config).cells if cell.starts], len(solves(tmp_path))
    store, phases = Store(tmp_path / "out"), phases_of(tmp_path / "out")
    for other in planned(config).cells:  # as another training leaves them
        if other.id in follower.starts:
            known = phases.read(other.phase_id)
            assert known is not None
            phases.keep(other.phase_id, replace(known, phase=known.phase + 1))
    store.remove([follower.id])
    compute(config, tmp_path / "out", Serial())
    assert len(solves(tmp_path)) == solved + 1
