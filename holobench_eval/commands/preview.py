"""What a study would compute, as a table, before it computes anything."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from rich.markup import escape
from rich.table import Table

from ..study import cost
from ..study.artifacts import FAILURE, UNFINISHED, Artifacts, known, progress
from ..study.displays import Preparation
from ..study.plan import Plan, Task
from ..study.store import State, Store

if TYPE_CHECKING:
    from ..study.definition import Study


@dataclass(frozen=True)
class Row:
    """A method of a plan.

    label; conditions: displays it is shown on; targets, cells: their numbers; captures: the method's own limit on
    camera captures, if it has one; done, failed, missing: cells by state; seconds: time its missing solutions would
    take, from the solutions that were timed before (None: none was).
    """

    label: str
    conditions: int
    targets: int
    cells: int
    captures: int | None
    done: int
    failed: int
    missing: int
    seconds: float | None


@dataclass(frozen=True)
class TrainingRow:
    """Something that a study's methods or its display must learn.

    name: of its artifact; needed_by: labels, or the display; state: ``unfinished`` and ``failed`` ones go on with the
    next run; captures, seconds: what it took, or has taken so far (NaN: not known); reason: why it failed.
    """

    name: str
    needed_by: tuple[str, ...]
    state: Literal["done", "unfinished", "failed", "missing"]
    captures: float
    seconds: float
    reason: str = ""


def trainings(plan: Plan, artifacts: Artifacts) -> list[TrainingRow]:
    """A row per artifact that a plan needs; nothing of it is loaded."""
    rows = []
    for identity, needed in plan.preparations().items():
        own = {task.label for task in plan.tasks if task.preparation and task.preparation.id == identity}
        shown = {
            place.name
            for task in plan.tasks
            for place in task.conditions
            if place.learned and place.learned.id == identity
        }
        rows.append(_training(needed, (*sorted(own), *(f"display {name}" for name in sorted(shown))), artifacts))
    return rows


def _training(needed: Preparation, needed_by: tuple[str, ...], artifacts: Artifacts) -> TrainingRow:
    place = artifacts.place(needed)
    if artifacts.has(needed):
        facts = known(place) or {}
        captures, seconds = (float(facts.get(key, math.nan)) for key in ("captures", "seconds"))
        return TrainingRow(needed.name, needed_by, "done", captures, seconds)
    if (place / FAILURE).is_file():
        return TrainingRow(needed.name, needed_by, "failed", *progress(place), artifacts.failure(needed))
    state: Literal["unfinished", "missing"] = "unfinished" if (place / UNFINISHED).is_dir() else "missing"
    return TrainingRow(needed.name, needed_by, state, *progress(place))


def training_table(rows: list[TrainingRow]) -> Table:
    """What has to be learned, as a table."""
    result = Table(title="training", title_justify="left")
    for name in ("artifact", "needed by", "state"):
        result.add_column(name, overflow="fold")
    result.add_column("captures", justify="right")
    result.add_column(escape("training [s]"), justify="right")
    for row in rows:
        figures = ("" if math.isnan(value) else f"{value:.4g}" for value in (row.captures, row.seconds))
        state = f"{row.state}: {row.reason}" if row.reason else row.state
        result.add_row(*map(escape, (row.name, ", ".join(row.needed_by), state)), *figures)
    return result


def preview(study: Study, plan: Plan, store: Store, threads: int, workers: int, gpu: str = "") -> list[Row]:
    """A row per method, the floor first. gpu: as in ``cost.key``, as are threads and workers."""
    limits = {entry.label: entry.captures or entry.params.get("captures") for entry in study.methods}
    labels = dict.fromkeys(task.label for task in plan.tasks)
    states, kept = store.states(plan.cells, cost.timed(study, plan)), cost.names()

    def seconds(task: Task) -> float | None:
        name = cost.key(task, threads, workers, gpu)
        effort = cost.known(name) if name in kept else None
        return None if effort is None else effort.seconds

    return [
        _row(label, [task for task in plan.tasks if task.label == label], limits.get(label), states, seconds)
        for label in labels
    ]


def _row(
    label: str,
    tasks: list[Task],
    limit: int | None,
    state: dict[str, State],
    seconds: Callable[[Task], float | None],
) -> Row:
    cells = [cell for task in tasks for cell in task.cells]
    states = [state[cell.id] for cell in cells]
    unsolved = [task for task in tasks if any(state[cell.id] == "missing" for cell in task.cells)]
    known = [seconds(task) for task in tasks if not task.is_floor]
    timed = [taken for taken in known if taken is not None]
    return Row(
        label=label,
        conditions=len({cell.condition for cell in cells}),
        targets=len({cell.target for cell in cells}),
        cells=len(cells),
        captures=limit if isinstance(limit, int) else None,
        done=states.count("done"),
        failed=states.count("failed"),
        missing=states.count("missing"),
        seconds=sum(timed) / len(timed) * len(unsolved) if timed else None,
    )


def table(study: Study, rows: list[Row]) -> Table:
    """The rows as a table with a line of sums."""
    result = Table(title=escape(study.title), title_justify="left", show_footer=True)
    result.add_column("method", footer="all", overflow="fold")
    for name in ("conditions", "targets"):
        result.add_column(name, justify="right")
    for name in ("cells", "done", "failed", "missing"):
        result.add_column(name, justify="right", footer=str(sum(getattr(row, name) for row in rows)))
    result.add_column("captures", justify="right")
    known = [row.seconds for row in rows if row.seconds is not None]
    untimed = any(row.seconds is None and row.label != "floor" for row in rows)
    solving = f"{'at least ' * untimed}{sum(known):.3g}" if known else ""
    result.add_column(escape("solving [s]"), justify="right", footer=solving)
    for row in rows:
        limit = "" if row.captures is None else str(row.captures)
        seconds = "" if row.label == "floor" else "not timed" if row.seconds is None else f"{row.seconds:.3g}"
        numbers = (row.conditions, row.targets, row.cells, row.done, row.failed, row.missing)
        result.add_row(escape(row.label), *map(str, numbers), limit, seconds)
    return result
