"""A metric that comes later costs a column: captures are scored again, and nothing is solved or photographed."""

import shutil
from collections import Counter
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from holobench_eval.display import CalibratedBench
from holobench_eval.report import facts_of, records_frame
from holobench_eval.report.results import difference
from holobench_eval.study import cost
from holobench_eval.study.config import load_study
from holobench_eval.study.phases import phases_of
from holobench_eval.study.plan import Cell
from holobench_eval.study.running import provenance
from holobench_eval.study.running.run import Outcome
from holobench_eval.study.store import Store
from tests.study.studies import exchanged, planned
from tests.support.studies import another_metric, trained_study
from tests.support.studies.another_metric import COLUMN, NAME
from tests.support.studies.trained_study import compute

ONE, BOTH = "protocol: {metrics: [psnr]}", f"protocol: {{metrics: [psnr, {NAME}]}}"
PICTURE = f"""\
title: "Again"
seed: 3
{ONE}
display: {{profiles: [leto-mild], panel: [128, 128]}}
targets: {{dataset: charts, params: {{names: [tv_lines, gray_ramp]}}}}
methods: [double_phase]
"""
TARGETS = "charts, params: {names: [tv_lines, gray_ramp]}"
FOCUS = exchanged(
    PICTURE,
    ("seed: 3", "seed: 3\nmeasure: focus\nheadline: psnr_linear_infocus"),
    (TARGETS, "focal_stacks, params: {planes: [0, 1.5], blur: 0.03}"),
    ("[double_phase]", "[{name: multi_plane, params: {iterations: 2}}, {name: wirtinger, params: {iterations: 2}}]"),
)
PREDICTION = exchanged(
    PICTURE,
    ("seed: 3", "seed: 3\nmeasure: prediction\nholograms: {params: {iterations: 2}}"),
    (TARGETS, '"trained.py:Pictures", params: {count: 2}'),
    ("[double_phase]", '["trained.py:Even"]'),
)
MEASURES = {"picture": PICTURE, "focus": FOCUS, "prediction": PREDICTION}


@pytest.fixture
def done(monkeypatch):
    """How often a method was at work, and how many photographs were taken for a score."""
    count: Counter[str] = Counter()

    def counted(where: Any, name: str, what: str) -> None:
        function = getattr(where, name)
        monkeypatch.setattr(where, name, lambda *args, **named: count.update([what]) or function(*args, **named))

    counted(cost, "Stopwatch", "solved")
    counted(CalibratedBench, "photograph", "photographed")
    return count


def written(folder: Path, text: str = PICTURE, metrics: str = ONE) -> Path:
    """The config of a study by some metrics."""
    path = trained_study.write(folder)
    path.write_text(text.replace(ONE, metrics))
    return path


@pytest.fixture(scope="module")
def base(tmp_path_factory):
    """Gives the folder of a study that was computed once, which no test changes."""

    @cache
    def computed(measure: str, metrics: str) -> Path:
        folder = tmp_path_factory.mktemp("base")
        with pytest.MonkeyPatch.context() as patch:
            another_metric.add(folder, patch)
            compute(written(folder, MEASURES[measure], metrics))
        return folder

    return computed


@pytest.fixture
def study(tmp_path, monkeypatch, base, done):
    """Gives the config of a study that was computed by a metric less than it names now."""
    another_metric.add(tmp_path, monkeypatch)

    def computed(measure: str = "picture", metrics: str = BOTH) -> Path:
        shutil.copytree(base(measure, ONE) / "out", tmp_path / "out")
        done.clear()
        return written(tmp_path, MEASURES[measure], metrics)

    return computed


@pytest.fixture
def fresh(base):
    """Gives the records of a study that was computed by both metrics at once."""

    def records(measure: str = "picture") -> list[dict[str, Any]]:
        folder = base(measure, BOTH)
        return measured(Store(folder / "out").load(planned(folder / "study.yaml")))

    return records


def measured(records: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Records without what each run measures itself, and without whether their phases were known before."""
    assert {record["state"] for record in records} == {"done"}, [record["reason"] for record in records]
    return [{**one, "seconds": None, "memory_mib": None, "cpu_s": None, "reused": None} for one in records]


def cells(config: Path) -> list[Cell]:
    """The cells that have a method."""
    return [cell for cell in planned(config).cells if cell.code]


def forget(config: Path, captures: bool = True, phases: bool = True) -> None:
    """Delete what a run in the folder ``out`` has kept."""
    kept, every = Store(config.parent / "out"), planned(config).cells
    for cell in every if captures else ():
        kept.capture(cell.id).unlink(missing_ok=True)
    for file in phases_of(config.parent / "out").folder.iterdir() if phases else ():
        file.unlink()


def column(outcome: Outcome, name: str = COLUMN) -> list[float | None]:
    return [record["scores"].get(name) for record in outcome.records]


@pytest.mark.parametrize("measure", MEASURES)
def test_a_new_metric_has_the_digits_of_a_fresh_run(study, fresh, done, measure):
    config = study(measure)
    grid, store = planned(config), Store(config.parent / "out")
    before = store.load(grid)
    frame = records_frame(before, facts_of(load_study(config)))
    assert difference(frame, grid) == ""
    again = compute(config, rescore=(NAME,))
    assert done == {}
    assert (again.computed, again.solved, again.rescored, again.unscored) == (0, 0, len(again.records), 0)
    assert None not in column(again)
    assert measured(again.records) == fresh(measure)
    assert untold(again.records) == untold(before)
    assert compute(config, rescore=(NAME,)).rescored == 0


def untold(records: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Records without their scores: what a run has measured."""
    return [{**record, "scores": None} for record in records]


def test_a_run_fills_the_column_too_and_solves_nothing(study, done):
    config = study()
    grid = planned(config)
    first = [record["scores"]["psnr_linear"] for record in Store(config.parent / "out").load(grid)]
    outcome = compute(config)
    assert done == {}
    assert (outcome.computed, outcome.rescored) == (0, len(outcome.records))
    assert None not in column(outcome)
    assert column(outcome, "psnr_linear") == first
    assert provenance.read(config.parent / "out")["scores"] == grid.metrics


def test_only_the_metrics_that_are_asked_for_are_filled_and_no_score_is_lost(study):
    config = study(metrics=BOTH.replace("psnr,", "psnr, gmsd,"))
    before = Store(config.parent / "out").load(planned(config))
    outcome = compute(config, rescore=(NAME,))  # from captures
    assert None not in column(outcome, "psnr_linear") + column(outcome)
    assert None in column(outcome, "gmsd_srgb")
    forget(config, phases=False)
    outcome = compute(config, rescore=("gmsd",))  # from phases
    assert None not in column(outcome, "psnr_linear") + column(outcome) + column(outcome, "gmsd_srgb")
    assert untold(outcome.records) == untold(before)


@pytest.mark.parametrize("measure", ["picture", "focus"])
def test_phases_are_shown_again_to_the_same_bits(study, fresh, done, measure):
    config = study(measure)
    store, every = Store(config.parent / "out"), cells(config)
    before = [store.capture(cell.id).read_bytes() for cell in every]
    forget(config, phases=False)
    again = compute(config, rescore=(NAME,))
    assert done == {"photographed": len(every)}
    assert (again.solved, again.unscored) == (0, 0)
    assert [store.capture(cell.id).read_bytes() for cell in every] == before
    assert measured(again.records) == fresh(measure)


@pytest.mark.parametrize("measure", MEASURES)
def test_a_hole_of_which_nothing_is_kept_waits_for_a_run(study, fresh, done, measure):
    config = study(measure)
    forget(config)
    again = compute(config, rescore=(NAME,))
    assert done == {}
    holes = len(again.records) if measure == "prediction" else len(cells(config))  # whose floor needs a capture, too
    assert (again.solved, again.unscored) == (0, holes)
    assert column(again).count(None) == holes
    whole = compute(config)
    assert done["solved"] > 0
    assert measured(whole.records) == fresh(measure)


def test_a_study_that_keeps_no_captures_is_scored_again_from_its_phases(study, done):
    config = study()
    config.write_text(f"{config.read_text()}save: {{kept: false}}\n")
    forget(config, phases=False)
    again = compute(config, rescore=(NAME,))
    assert done == {"photographed": 2}
    assert None not in column(again)
    assert not list((config.parent / "out" / "records").glob("*.npy"))


@pytest.mark.parametrize("damage", ["truncated", "a bit", "empty", "another file", "another cell's"])
def test_the_phase_of_a_damaged_capture_is_photographed_again(study, done, damage):
    config = study()
    file, other = (Store(config.parent / "out").capture(cell.id) for cell in cells(config)[:2])
    content = file.read_bytes()
    bad = {
        "truncated": content[: len(content) // 2],
        "a bit": content[:9000] + bytes([content[9000] ^ 1]) + content[9001:],
        "empty": b"",
        "another file": b"PNG" * 100,
        "another cell's": other.read_bytes(),
    }
    file.write_bytes(bad[damage])
    again = compute(config, rescore=(NAME,))
    assert done == {"photographed": 1}
    assert (again.rescored, again.unscored) == (len(again.records), 0)
    assert file.read_bytes() == content
    assert None not in column(again)


def test_records_are_those_of_another_study_only_where_the_captures_are(study):
    config = study(metrics=ONE)
    config.write_text(config.read_text().replace("seed: 3", "seed: 4"))
    again = compute(config, rescore=("psnr",))
    assert (again.computed, again.rescored) == (0, 0)
    assert {record["state"] for record in again.records if record["label"] == "double_phase"} == {"missing"}
