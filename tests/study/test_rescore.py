"""A metric that comes later costs a column: captures are scored again, and nothing is solved or photographed."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from holobench_eval.display import CalibratedBench
from holobench_eval.report import layout_of, records_frame
from holobench_eval.report.data.tables import difference
from holobench_eval.study import cost, provenance
from holobench_eval.study.config import load_study
from holobench_eval.study.phases import phases_of
from holobench_eval.study.plan import Cell, plan
from holobench_eval.study.run import Outcome
from holobench_eval.study.store import Store
from tests.support import another_metric, trained_study
from tests.support.another_metric import COLUMN, NAME
from tests.support.trained_study import compute

ONE, BOTH = "protocol: {metrics: [psnr]}", f"protocol: {{metrics: [psnr, {NAME}]}}"
PICTURE = f"""\
title: "Again"
seed: 3
{ONE}
display: {{profiles: [leto-mild], panel: [128, 128]}}
targets: {{dataset: charts, params: {{names: [tv_lines, gray_ramp]}}}}
methods: [double_phase]
"""
FOCUS = (
    PICTURE.replace("seed: 3", "seed: 3\nmeasure: focus\nheadline: psnr_linear_infocus")
    .replace("charts, params: {names: [tv_lines, gray_ramp]}", "focal_stacks, params: {planes: [0, 1.5], blur: 0.03}")
    .replace(
        "[double_phase]", "[{name: multi_plane, params: {iterations: 2}}, {name: wirtinger, params: {iterations: 2}}]"
    )
)
PREDICTION = (
    PICTURE.replace("seed: 3", "seed: 3\nmeasure: prediction\nholograms: {params: {iterations: 2}}")
    .replace("charts, params: {names: [tv_lines, gray_ramp]}", '"trained.py:Pictures", params: {count: 2}')
    .replace("[double_phase]", '["trained.py:Even"]')
)
MEASURES = {"picture": PICTURE, "focus": FOCUS, "prediction": PREDICTION}


@pytest.fixture
def done(monkeypatch: pytest.MonkeyPatch) -> Counter[str]:
    """How often a method was at work, and how many photographs were taken for a score."""
    count: Counter[str] = Counter()
    start, photograph = cost.start, CalibratedBench.photograph

    def started(*args: Any, **named: Any) -> Any:
        count["solved"] += 1
        return start(*args, **named)

    def photographed(*args: Any, **named: Any) -> Any:
        count["photographed"] += 1
        return photograph(*args, **named)

    monkeypatch.setattr(cost, "start", started)
    monkeypatch.setattr(CalibratedBench, "photograph", photographed)
    return count


@pytest.fixture
def study(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Path]:
    """Writes a study; the metric is there, and it names it or not."""
    another_metric.add(tmp_path, monkeypatch)

    def written(text: str = PICTURE, metrics: str = ONE) -> Path:
        path = trained_study.write(tmp_path)
        path.write_text(text.replace(ONE, metrics))
        return path

    return written


def measured(outcome: Outcome) -> list[dict[str, Any]]:
    """Records without what each run measures itself, and without whether their phases were known before."""
    assert {record["state"] for record in outcome.records} == {"done"}, [r["reason"] for r in outcome.records]
    return [{**one, "seconds": None, "memory_mib": None, "cpu_s": None, "reused": None} for one in outcome.records]


def cells(config: Path) -> list[Cell]:
    """The cells that have a method."""
    return [cell for cell in plan(load_study(config)).cells if cell.code]


def forget(config: Path, captures: bool = True, phases: bool = True) -> None:
    """Delete what a run in the folder ``out`` has kept."""
    kept, every = Store(config.parent / "out"), plan(load_study(config)).cells
    for cell in every if captures else ():
        kept.capture(cell.id).unlink(missing_ok=True)
    for file in phases_of(config.parent / "out").folder.iterdir() if phases else ():
        file.unlink()


def column(outcome: Outcome, name: str = COLUMN) -> list[float | None]:
    return [record["scores"].get(name) for record in outcome.records]


@pytest.mark.parametrize("measure", MEASURES)
def test_a_new_metric_is_filled_from_kept_captures_to_the_last_digit_of_a_fresh_run(
    study: Callable[..., Path], done: Counter[str], measure: str
) -> None:
    compute(study(MEASURES[measure]))
    done.clear()
    config = study(MEASURES[measure], BOTH)
    grid = plan(load_study(config))
    frame = records_frame(Store(config.parent / "out").load(grid), layout_of(load_study(config)))
    assert difference(frame, grid) == ""
    again = compute(config, rescore=(NAME,))
    assert done == {}
    assert (again.computed, again.solved, again.rescored, again.unscored) == (0, 0, len(again.records), 0)
    assert None not in column(again)
    assert measured(again) == measured(compute(config, "fresh"))
    assert compute(config, rescore=(NAME,)).rescored == 0


def test_a_run_fills_the_column_too_and_solves_nothing(study: Callable[..., Path], done: Counter[str]) -> None:
    first = compute(study())
    done.clear()
    outcome = compute(study(metrics=BOTH))
    assert done == {}
    assert (outcome.computed, outcome.rescored) == (0, len(outcome.records))
    assert None not in column(outcome)
    assert column(outcome, "psnr_linear") == column(first, "psnr_linear")
    assert provenance.read(study().parent / "out")["scores"] == plan(load_study(study(metrics=BOTH))).metrics


def test_what_a_run_measured_stays_in_the_record(study: Callable[..., Path]) -> None:
    def told(outcome: Outcome) -> list[dict[str, Any]]:
        return [{**record, "scores": None} for record in outcome.records]

    first = compute(study())
    assert told(compute(study(metrics=BOTH), rescore=(NAME,))) == told(first)
    forget(study(), phases=False)
    another = BOTH.replace("psnr,", "psnr, gmsd,")
    assert told(compute(study(metrics=another), rescore=("gmsd",))) == told(first)


def test_a_metric_of_a_new_version_is_a_hole_until_it_is_scored_again(
    study: Callable[..., Path], done: Counter[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    config = study(metrics=BOTH)
    old = compute(config)
    another_metric.add(tmp_path, monkeypatch, version=2)
    grid, store = plan(load_study(config)), Store(tmp_path / "out")
    assert set(store.states(grid.cells, metrics=grid.metrics).values()) == {"unscored"}
    assert {record["scores"].get(COLUMN) for record in store.load(grid)} == {None}
    assert [record["scores"]["psnr_linear"] for record in store.load(grid)] == column(old, "psnr_linear")
    done.clear()
    new = compute(config, rescore=(NAME,))
    assert done == {}
    assert column(new) == [pytest.approx(2 * value) for value in column(old) if value is not None]
    assert measured(new) == measured(compute(config, "fresh"))


def test_only_the_metrics_that_are_asked_for_are_filled_and_no_score_is_lost(study: Callable[..., Path]) -> None:
    compute(study())
    config = study(metrics=BOTH.replace("psnr,", "psnr, gmsd,"))
    for lost in (False, True):  # once from captures, once from phases
        if lost:
            forget(config, phases=False)
        wanted, other = (NAME, "gmsd") if not lost else ("gmsd", NAME)
        outcome = compute(config, rescore=(wanted,))
        assert None not in column(outcome, "psnr_linear")
        assert (None in column(outcome, "gmsd_srgb")) == (not lost)
        assert None not in column(outcome)
        assert other in plan(load_study(config)).metrics


@pytest.mark.parametrize("measure", ["picture", "focus"])
def test_without_captures_phases_are_shown_again_to_the_same_bits(
    study: Callable[..., Path], done: Counter[str], measure: str
) -> None:
    config = study(MEASURES[measure])
    compute(config)
    store, every = Store(config.parent / "out"), cells(config)
    before = [store.capture(cell.id).read_bytes() for cell in every]
    forget(config, phases=False)
    done.clear()
    config = study(MEASURES[measure], BOTH)
    again = compute(config, rescore=(NAME,))
    assert done == {"photographed": len(every)}
    assert (again.solved, again.unscored) == (0, 0)
    assert [store.capture(cell.id).read_bytes() for cell in every] == before
    assert measured(again) == measured(compute(config, "fresh"))


@pytest.mark.parametrize("measure", MEASURES)
def test_where_neither_is_kept_there_stays_a_hole_that_a_run_fills(
    study: Callable[..., Path], done: Counter[str], measure: str
) -> None:
    compute(study(MEASURES[measure]))
    config = study(MEASURES[measure], BOTH)
    forget(config)
    done.clear()
    again = compute(config, rescore=(NAME,))
    assert done == {}
    holes = len(again.records) if measure == "prediction" else len(cells(config))  # whose floor needs a capture, too
    assert (again.solved, again.unscored) == (0, holes)
    assert column(again).count(None) == holes
    whole = compute(config)
    assert done["solved"] > 0
    assert measured(whole) == measured(compute(config, "fresh"))


def test_a_study_that_keeps_no_captures_is_scored_again_from_its_phases(
    study: Callable[..., Path], done: Counter[str]
) -> None:
    bare = "save: {kept: false}\n"
    config = study()
    config.write_text(config.read_text() + bare)
    compute(config)
    assert not list((config.parent / "out" / "records").glob("*.npy"))
    done.clear()
    config = study(metrics=BOTH)
    config.write_text(config.read_text() + bare)
    again = compute(config, rescore=(NAME,))
    assert done == {"photographed": 2}
    assert None not in column(again)


@pytest.mark.parametrize("damage", ["truncated", "a bit", "empty", "another file"])
def test_a_damaged_capture_is_never_a_score_and_its_phase_is_photographed_again(
    study: Callable[..., Path], done: Counter[str], damage: str
) -> None:
    compute(study())
    config = study(metrics=BOTH)
    store, (first, second) = Store(config.parent / "out"), cells(config)
    file = store.capture(first.id)
    content = file.read_bytes()
    bad = {
        "truncated": content[: len(content) // 2],
        "a bit": content[:9000] + bytes([content[9000] ^ 1]) + content[9001:],
        "empty": b"",
        "another file": b"PNG" * 100,
    }
    file.write_bytes(bad[damage])
    done.clear()
    again = compute(config, rescore=(NAME,))
    assert done == {"photographed": 1}
    assert (again.rescored, again.unscored) == (len(again.records), 0)
    assert file.read_bytes() == content
    assert None not in column(again)
    assert second.id != first.id


def test_records_are_those_of_another_study_only_where_the_captures_are(study: Callable[..., Path]) -> None:
    config = study()
    compute(config)
    config.write_text(config.read_text().replace("seed: 3", "seed: 4"))
    again = compute(config, rescore=("psnr",))
    assert (again.computed, again.rescored) == (0, 0)
    assert {record["state"] for record in again.records if record["label"] == "double_phase"} == {"missing"}
