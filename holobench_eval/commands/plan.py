"""``holoeval plan``: what a study would compute, before it computes anything."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from rich.markup import escape
from rich.table import Table

from .options import Config, Device, Learned, Output, Threads, is_small, output_folder, thread_count
from .output import console as open_console

if TYPE_CHECKING:
    from ..study.artifacts import Artifacts
    from ..study.config import Study
    from ..study.plan import Plan, Task
    from ..study.preparation import Preparation
    from ..study.store import State, Store


def plan(
    config: Config,
    output: Output = None,
    threads: Threads = None,
    device: Device = "auto",
    artifacts: Learned = Path("artifacts"),
) -> None:
    """Show what a study would compute, and what of it is done; compute nothing."""
    from ..core.device import find, gpu_name, gpus
    from ..study.artifacts import Artifacts
    from ..study.config import load_study
    from ..study.executors import executor
    from ..study.plan import plan as plan_cells
    from ..study.store import Store

    console, study = open_console(), load_study(config)
    folder = output_folder(study, output)
    workers = executor("auto", None, is_small(study.display.panel), gpus=gpus(device)).workers
    grid = plan_cells(study)
    rows = preview(study, grid, Store(folder), thread_count(threads, workers, study), workers, gpu_name(find(device)))
    console.print(table(study, rows))
    if needed := trainings(grid, Artifacts(artifacts)):
        console.print(training_table(needed))
    console.print(f"output folder: {folder}", highlight=False, soft_wrap=True)


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


def preview(study: Study, plan: Plan, store: Store, threads: int, workers: int, gpu: str = "") -> list[Row]:
    """Count the cells of every method of a plan, the floor first.

    Parameters
    ----------
    study, plan, store
        What is asked for, its cells, and the records that are there.
    threads, workers, gpu
        How it would be computed, as in ``study.timings.key``: times of other machines say nothing.
    """
    from ..study import timings

    limits = {entry.label: entry.captures or entry.params.get("captures") for entry in study.methods}
    states, kept = store.states(plan.cells, timings.timed(study, plan)), timings.names()

    def seconds(task: Task) -> float | None:
        name = timings.key(task, threads, workers, gpu)
        cost = timings.known(name) if name in kept else None
        return None if cost is None else cost.seconds

    tasks: dict[str, list[Task]] = {}
    for task in plan.tasks:
        tasks.setdefault(task.label, []).append(task)
    return [_row(label, own, limits.get(label), states, seconds) for label, own in tasks.items()]


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
    timed = [duration for duration in known if duration is not None]
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


def trainings(plan: Plan, artifacts: Artifacts) -> list[TrainingRow]:
    """A row for every artifact that a plan needs; no artifact is loaded."""
    rows = []
    for identity, needed in plan.preparations().items():
        labels = {task.label for task in plan.tasks if task.preparation and task.preparation.id == identity}
        displays = {
            f"display {display.name}"
            for task in plan.tasks
            for display in task.conditions
            if display.learned and display.learned.id == identity
        }
        rows.append(_training(needed, (*sorted(labels), *sorted(displays)), artifacts))
    return rows


def _training(needed: Preparation, needed_by: tuple[str, ...], artifacts: Artifacts) -> TrainingRow:
    from ..study.artifacts import FAILURE, UNFINISHED
    from ..study.training_log import known, progress

    folder = artifacts.place(needed)
    if artifacts.has(needed):
        facts = known(folder) or {}
        captures, seconds = (float(facts.get(key, math.nan)) for key in ("captures", "seconds"))
        return TrainingRow(needed.name, needed_by, "done", captures, seconds)
    if (folder / FAILURE).is_file():
        return TrainingRow(needed.name, needed_by, "failed", *progress(folder), artifacts.failure(needed))
    state: Literal["unfinished", "missing"] = "unfinished" if (folder / UNFINISHED).is_dir() else "missing"
    return TrainingRow(needed.name, needed_by, state, *progress(folder))


def training_table(rows: list[TrainingRow]) -> Table:
    """What has to be learned, as a table."""
    result = Table(title="training", title_justify="left")
    for name in ("artifact", "needed by", "state"):
        result.add_column(name, overflow="fold")
    for name in ("captures", "training [s]"):
        result.add_column(escape(name), justify="right")
    for row in rows:
        figures = ("" if math.isnan(value) else f"{value:.4g}" for value in (row.captures, row.seconds))
        state = f"{row.state}: {row.reason}" if row.reason else row.state
        result.add_row(*map(escape, (row.name, ", ".join(row.needed_by), state)), *figures)
    return result
