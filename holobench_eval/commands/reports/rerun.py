"""``holoeval check --rerun``: solve a sample of a report's cells again, and judge every number of theirs."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from ...core.errors import UserError, listed
from ..options import thread_count

if TYPE_CHECKING:
    import pandas as pd

    from ...study.definition import Study
    from ...study.executors import Executor
    from ...study.plan import Cell, Plan, Task

Key = tuple[str, str, str, float]  # method's label, display, target and repeat: they name a cell in records.csv

# Largest difference of a number between two machines: PSNR in dB, other scores in their own unit. Of the 812 cells of
# an earlier Table 3, on processors of two makers, the largest were 0.045 dB and 0.016: docs/results/compare.md.
TOLERANCE_DB, TOLERANCE = 0.05, 0.02
# How a capture was matched with its target: no score, and where the match has several equal answers, not one number.
MATCHES = ("scale_", "match_factor", "refine_")
# Phase congruency of a flat image is made of rounding errors.
FLAT, OF_EDGES = ("floor_constant", "floor_black"), ("fsim", "vsi")


@dataclass(frozen=True)
class Planned:
    """A cell that a config plans, with its task, its name in records.csv and the row of that name."""

    task: Task
    cell: Cell
    key: Key
    row: Mapping[Any, Any]

    def __str__(self) -> str:
        method, display, target, repeat = self.key
        return f"{method} on {display}, {target}{f', repeat {repeat:g}' if repeat else ''}"


@dataclass
class Verdict:
    """What a rerun found.

    cells: computed again; reproduced, close: numbers with equal digits, and others within the tolerance; faults: a line
    for every number that is neither; notes: what was not computed again, and why.
    """

    cells: int = 0
    reproduced: int = 0
    close: int = 0
    faults: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def __str__(self) -> str:
        return (
            f"{self.cells} cells computed again: {self.reproduced} numbers reproduced, {self.close} within tolerance "
            f"({TOLERANCE_DB:g} dB; {TOLERANCE:g} for other scores), {len(self.faults)} not"
        )


def rerun(report: Path, study: Study, count: int, seed: int, artifacts: Path, where: Executor) -> Verdict:
    """Compute a sample of a report's cells again, in a temporary folder and by the study's own run.

    Parameters
    ----------
    report, study
        Folder with records.csv, and the study of its config.
    count, seed
        Size of the sample, and what it is drawn by; see ``sample``.
    artifacts
        Folder of what methods learned; nothing is trained.
    where
        Computes the cells.

    Returns
    -------
    Verdict
        On every number of the sample.

    Raises
    ------
    UserError
        records.csv or an artifact is damaged.
    """
    from ...report.compare import read_run
    from ...report.results import DONE, score_columns
    from ...study.plan import plan as plan_cells

    records, plan = read_run(report), plan_cells(study)
    rows, verdict = _by_key(records), Verdict()
    tasks = [task for task in plan.tasks for _ in task.cells]
    keys = [(label, cell.condition, cell.target, cell.repeat) for label, cell in plan.labelled()]
    lacking, unscored = len(rows.keys() - {*keys}), int((records["state"] != DONE).sum())
    for number, what in ((lacking, "that the config does not plan"), (unscored, "without a score")):
        if number:
            verdict.notes.append(f"not rerun: {number} row{'s' * (number > 1)} of records.csv {what}")
    cells = [Planned(*each, rows[each[2]]) for each in zip(tasks, plan.cells, keys, strict=True) if each[2] in rows]
    scored = [each for each in cells if each.row["state"] == DONE]
    obstacles = _obstacles(study, plan, scored, artifacts)
    for why in dict.fromkeys(obstacles.values()):
        labels = [each.task.label for each in scored if obstacles.get(each.cell.id) == why]
        count_of = f"{len(labels)} cell{'s' * (len(labels) > 1)}"
        verdict.notes.append(f"not rerun: {listed(dict.fromkeys(labels))} ({count_of}): {why}")
    chosen = sample([each for each in scored if each.cell.id not in obstacles], count, seed)
    if chosen:
        verdict.cells = len(chosen)
        _judge(chosen, _computed(study, chosen, artifacts, where), score_columns(records), verdict)
    return verdict


def sample(cells: Sequence[Planned], count: int, seed: int) -> list[Planned]:
    """``count`` of the cells, evenly over methods and displays, which of their targets by lot.

    Every next cell is of a method, then of a pair of method and display, then of a display with the fewest so far. The
    floors count as one method.
    """
    from ...core.seeds import seed as seed_of

    waiting = sorted(cells, key=lambda each: seed_of("check --rerun", seed, *each.key))
    methods, pairs, displays = Counter[str](), Counter[tuple[str, str]](), Counter[str]()
    chosen: list[Planned] = []
    while waiting and len(chosen) < count:
        fewest = min(
            waiting,
            key=lambda each: (methods[each.task.label], pairs[each.key[:2]], displays[each.key[1]]),
        )
        waiting.remove(fewest)
        chosen.append(fewest)
        methods[fewest.task.label] += 1
        pairs[fewest.key[:2]] += 1
        displays[fewest.key[1]] += 1
    return chosen


def _by_key(records: pd.DataFrame) -> dict[Any, dict[Any, Any]]:
    from ...report.compare import CELL

    return records.set_index(list(CELL), drop=False).to_dict("index")


def _obstacles(study: Study, plan: Plan, cells: Sequence[Planned], artifacts: Path) -> dict[str, str]:
    """Why cells cannot be computed again, by their ids; nothing for those that can."""
    from ...study.artifacts import Artifacts
    from ...study.plan import Plan
    from ...study.running.run import refuse_unavailable, refuse_unscored

    if study.display.real:
        return {each.cell.id: "photographs of a real display" for each in cells}
    try:
        refuse_unscored(study)
    except UserError as error:
        return {each.cell.id: str(error) for each in cells}
    tasks, store = {each.task.label: each.task for each in reversed(cells)}, Artifacts(artifacts)
    untrained = {name for name, training in plan.preparations().items() if not store.has(training)}

    @cache
    def unavailable(label: str) -> str:
        task = tasks[label]
        try:
            refuse_unavailable(Plan((task,)), frozenset((task.cells[0].id,)), study.folder)
        except UserError as error:
            return str(error)
        return ""

    def reason(each: Planned) -> str:
        if each.cell.starts:
            return "starts from the phases of all other methods, which records.csv has not"
        if untrained.isdisjoint(each.cell.prepared):
            return unavailable(each.task.label)
        seconds = float(each.row.get("training_s", 0))
        length = f"about {max(1, round(seconds / 60))} min" if 0 < seconds < math.inf else "unknown length"
        return f"needs training of {length}, and {artifacts} has no artifact of it"

    return {each.cell.id: why for each in cells if (why := reason(each))}


def _computed(study: Study, chosen: Sequence[Planned], artifacts: Path, where: Executor) -> dict[Key, dict[Any, Any]]:
    """The rows of records.csv of the chosen cells, computed now.

    The other cells of their tasks, which share a solution with them, are recorded as skipped beforehand.
    """
    from ...report.facts import facts_of
    from ...report.results import records_frame
    from ...study.identity import scores_of
    from ...study.plan import Plan
    from ...study.running.progress import Lines
    from ...study.running.run import run
    from ...study.store import Record, Store

    wanted = {each.cell.id for each in chosen}
    tasks = {each.task.cells[0].id: each.task for each in chosen}
    plan = Plan(tuple(tasks.values()), scores_of(study))
    with TemporaryDirectory(prefix="holoeval-check-") as folder:
        store = Store(Path(folder))
        for label, cell in plan.labelled():
            if cell.id not in wanted:
                store.write(Record(cell.description(), "skipped", label, "not in the sample"))
        threads = thread_count(None, where.workers, study)
        outcome = run(study, plan, store.output, where, Lines(lambda line: None), threads, artifacts)
    return _by_key(records_frame(outcome.records, facts_of(study)))


def _judge(
    chosen: Sequence[Planned], again: Mapping[Key, Mapping[Any, Any]], scores: Sequence[str], verdict: Verdict
) -> None:
    """Count the numbers of the chosen cells that are reproduced, and note the others."""
    from ...metrics.protocol import VERSION as PROTOCOL
    from ...report.results import DONE, rounded
    from ...report.scores import parse

    others = sum(each.cell.id != each.row["cell"] for each in chosen)
    if others:
        verdict.notes.append(
            f"{others} of the cells in records.csv have another identity: the study, a method, a display or the "
            "harness have changed since"
        )
    if earlier := {str(each.row["protocol"]) for each in chosen} - {PROTOCOL}:
        verdict.notes.append(f"scores by metric protocol {', '.join(sorted(earlier))} beside those by {PROTOCOL} now")
    known = {name for row in again.values() for name, value in row.items() if value == value}  # NaN is not itself
    lacking = [
        name for name in scores if name not in known and any(each.row[name] == each.row[name] for each in chosen)
    ]
    if lacking:
        verdict.notes.append(f"not rerun: {', '.join(lacking)}: not computed on this machine")
    for each in chosen:
        row = again[each.key]
        if row["state"] != DONE:
            verdict.faults.append(f"{each}: had a score, is {row['state']} now: {row['reason']}")
            continue
        learned = [str(cells.get("learned_sha256", "")) for cells in (each.row, row)]
        if learned[0] != learned[1]:
            was, now = (sha256[:12] or "nothing" for sha256 in learned)
            verdict.faults.append(f"{each}: learned state was {was}, is {now}: another artifact")
        for name in (name for name in scores if name not in lacking and not name.startswith(MATCHES)):
            score, number, found = parse(name), float(each.row[name]), float(row.get(name, math.nan))
            if math.isnan(number) or (each.cell.method in FLAT and score.metric in OF_EDGES):
                continue
            if rounded(number) == rounded(found):
                verdict.reproduced += 1
            elif abs(number - found) <= (TOLERANCE_DB if score.unit == "dB" else TOLERANCE):
                verdict.close += 1
            else:
                told = "missing" if math.isnan(found) else f"{found:.6g}"
                verdict.faults.append(f"{each}: {score.key}{score.brackets} was {number:.6g}, is {told}")
