"""``holoeval plan``: what a study would compute, before it computes anything."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import mean
from typing import TYPE_CHECKING, Any

from rich import box
from rich.markup import escape
from rich.table import Table

from ..core.errors import listed
from ..core.installed import shipped_configs
from ..core.panels import is_small
from . import options
from .output import console as open_console

if TYPE_CHECKING:
    from ..study.artifacts import Artifacts
    from ..study.definition import MethodEntry, Study
    from ..study.plan import Plan
    from ..study.store import Store

FLOOR = "floor"  # the label of the row of floor cells
STATES = ("done", "failed", "missing")  # of cells
LOOK: dict[str, Any] = {"box": box.SIMPLE_HEAD, "padding": 0, "show_edge": False}  # of tables


def plan(
    config: options.Config,
    output: options.Output = None,
    methods: options.Methods = None,
    targets: options.Targets = None,
    limit: options.Limit = None,
    values: options.Values = None,
    threads: options.Threads = None,
    device: options.Device = "auto",
    artifacts: options.Learned = options.ARTIFACTS,
) -> None:
    """Show what a study would compute, and what of it is done; compute nothing."""
    studies = options.studies(config, output, options.changes_of(methods, targets, limit, values))
    rows = [row for study, folder in studies for row in _show(study, folder, threads, device, artifacts)]
    if len(studies) > 1:
        sums = ", ".join(f"{sum(getattr(row, name) for row in rows)} {name}" for name in STATES)
        print(f"{len(studies)} studies: {sums} of {sum(row.cells for row in rows)} cells")


def _show(study: Study, folder: Path, threads: int | None, device: str, artifacts: Path) -> list[Row]:
    """Print the plan of a study, and return its rows."""
    from ..core.device import find, gpu_name, gpus
    from ..study.artifacts import Artifacts
    from ..study.executors import executor
    from ..study.plan import plan as plan_cells
    from ..study.store import Store

    console = open_console()
    workers = executor("auto", None, is_small(study.display.panel), gpus=gpus(device)).workers
    grid, many = plan_cells(study), options.thread_count(threads, workers, study)
    artifacts = options.learned_folder(artifacts, grid)
    networks = Artifacts(artifacts).networks(grid.preparations().values())
    learning = trainings(grid, Artifacts(artifacts))
    rows = preview(study, grid, Store(folder), many, workers, gpu_name(find(device)), networks, learning)
    console.print(table(study, rows))
    if unscored := sum(row.unscored for row in rows):
        names = listed(dict.fromkeys(name for row in rows for name in row.lacking))
        console.print(
            f"{unscored} of the done cells lack scores: {names}. 'holoeval rescore' fills them from kept captures, and "
            "'holoeval run' the rest on a simulated display.",
            soft_wrap=True,
        )
    if all(row.seconds is None for row in rows):
        console.print("No method of it was timed on this machine before; 'holoeval run' says what is left.")
    if learning:
        console.print(training_table(learning))
        if not artifacts.is_dir() and study.file.resolve() in shipped_configs().values():
            console.print(
                "A clone of the repository has what the shipped studies need in its folder artifacts; with --artifacts "
                "FOLDER it need not be trained.",
            )
    console.print(f"output folder: {folder}", soft_wrap=True)
    return rows


@dataclass(frozen=True)
class Row:
    """A method of a plan.

    label; conditions: displays it is shown on; targets, cells: their numbers; photographs: the most in total on each
    display as on the board, those of its training included (None: of floors; NaN: not known before its training); done,
    failed, missing: cells by state; seconds: time its missing solutions would take, from the solutions that were timed
    before (None: none was); unscored: those of the done cells that lack scores; lacking: the names of these scores.
    """

    label: str
    conditions: int
    targets: int
    cells: int
    photographs: float | None
    done: int
    failed: int
    missing: int
    seconds: float | None
    unscored: int = 0
    lacking: tuple[str, ...] = ()


@dataclass(frozen=True)
class TrainingRow:
    """Something that a study's methods or its display must learn.

    name: of its artifact; needed_by: labels, or the display; state: done, unfinished, failed or missing, of which the
    next run goes on with the unfinished and the failed; captures, seconds: what it took, or has taken so far (NaN: not
    known); reason: why it failed.
    """

    name: str
    needed_by: tuple[str, ...]
    state: str
    captures: float
    seconds: float
    reason: str = ""


def preview(
    study: Study,
    plan: Plan,
    store: Store,
    threads: int,
    workers: int,
    gpu: str = "",
    networks: Mapping[str, str] | None = None,
    learning: Sequence[TrainingRow] = (),
) -> list[Row]:
    """Count the cells of every method of a plan, the floor first. threads, workers, gpu: as in ``cost.key``; networks:
    as in ``Store.states``; learning: what the plan's methods must learn."""
    from ..study import cost, isolation
    from ..study.identity import lacking

    methods = {entry.label: entry for entry in study.methods}
    states = store.states(plan.cells, cost.timed(study, plan), plan.metrics, study.folder, networks or {})
    rows = []
    for label in dict.fromkeys(task.label for task in plan.tasks):
        tasks = [task for task in plan.tasks if task.label == label]
        cells = [cell for task in tasks for cell in task.cells]
        count = Counter(states[cell.id] for cell in cells)
        unsolved = [task for task in tasks if any(states[cell.id] in ("missing", "untimed") for cell in task.cells)]
        is_floor, method = tasks[0].is_floor, tasks[0].cells[0].method
        apart = not is_floor and not isolation.runs_inside(method, study.folder, study.isolation)
        kinds = Counter(cost.key(task, threads, workers, gpu, apart) for task in unsolved if not is_floor)
        known = {kind: seconds for kind in kinds if (seconds := cost.recorded(kind)) is not None}
        estimates = [known.get(kind, mean(known.values())) * many for kind, many in kinds.items()] if known else []
        targets = len({cell.target for cell in cells})
        kept = (store.read(cell.id) for cell in cells if states[cell.id] == "unscored")
        unscored = [lacking(record.scores, plan.metrics) for record in kept if record]
        rows.append(
            Row(
                label,
                conditions=len({cell.condition for cell in cells}),
                targets=targets,
                cells=len(cells),
                photographs=None if is_floor else _photographs(methods[label], study.folder, targets, learning),
                done=count["done"] + count["unscored"],
                failed=count["failed"],
                missing=count["missing"] + count["untimed"],
                seconds=None if is_floor or (kinds and not known) else sum(estimates),
                unscored=len(unscored),
                lacking=tuple(dict.fromkeys(name for names in unscored for name in names)),
            )
        )
    return rows


def _photographs(entry: MethodEntry, folder: Path, targets: int, learning: Sequence[TrainingRow]) -> float:
    """Those of a method on a display: of its training, and of every target."""
    from ..study import isolation

    learned = [row.captures if row.state == "done" else math.nan for row in learning if entry.label in row.needed_by]
    limits = [limit for limit in (entry.captures, entry.params.get("captures")) if isinstance(limit, int)]
    each = min(limits, default=math.nan) if isolation.traits(entry.name, folder).camera else 0
    return targets * each + (mean(learned) if learned else 0)


def table(study: Study, rows: list[Row]) -> Table:
    """The rows as a table with a line of sums, in 80 columns; without the time of solving where none is known."""
    from ..study.running.progress import duration

    result = Table(title=escape(study.title), title_justify="left", show_footer=True, **LOOK)
    floors = sum(row.cells for row in rows if row.label == FLOOR)
    result.add_column("method", footer=f"all, {floors} of them floors" if floors else "all", overflow="fold")
    numbers = ("conditions", "targets", "cells", *STATES)
    for name in numbers:
        total = str(sum(getattr(row, name) for row in rows)) if name in numbers[2:] else ""
        result.add_column("displays" if name == "conditions" else name, justify="right", footer=total)
    result.add_column("photos", justify="right")
    result.caption = "photos: at most, in total on each display; ?: known once it is trained, or has solved"
    timed = [row.seconds for row in rows if row.seconds is not None]
    untimed = any(row.seconds is None and row.label != FLOOR for row in rows)
    if timed:
        result.add_column("solving", justify="right", footer=f"{'at least ' * untimed}{duration(sum(timed))}")
    for row in rows:
        photos = "" if row.photographs is None else "?" if math.isnan(row.photographs) else f"{row.photographs:.0f}"
        seconds = "" if row.label == FLOOR else "not timed" if row.seconds is None else duration(row.seconds)
        name = "floor images, no method" if row.label == FLOOR else row.label
        counts = (str(getattr(row, name)) for name in numbers)
        result.add_row(escape(name), *counts, photos, *([seconds] if timed else []))
    return result


def trainings(plan: Plan, artifacts: Artifacts) -> list[TrainingRow]:
    """A row for every artifact that a plan needs; no artifact is loaded."""
    from ..study.artifacts import FAILURE, UNFINISHED, progress, provenance_of

    rows = []
    for identity, preparation in plan.preparations().items():
        labels = {task.label for task in plan.tasks if task.preparation and task.preparation.id == identity}
        displays = {
            f"display {display.name}"
            for task in plan.tasks
            for display in task.conditions
            if display.learned and display.learned.id == identity
        }
        folder, reason = artifacts.folder_of(preparation), ""
        if artifacts.has(preparation):
            state, facts = "done", provenance_of(folder) or {}
            captures, seconds = (float(facts.get(key, math.nan)) for key in ("captures", "seconds"))
        else:
            state = "unfinished" if (folder / UNFINISHED).is_dir() else "missing"
            captures, seconds = progress(folder)
            if (folder / FAILURE).is_file():
                state, reason = "failed", artifacts.failure(preparation)
        needed_by = (*sorted(labels), *sorted(displays))
        rows.append(TrainingRow(preparation.name, needed_by, state, captures, seconds, reason))
    return rows


def training_table(rows: list[TrainingRow]) -> Table:
    """What has to be learned, as a table in 80 columns; artifacts without the digest in their names."""
    from ..study.running.progress import duration

    result = Table(title="training", title_justify="left", **LOOK)
    for name in ("artifact", "needed by", "state"):
        result.add_column(name, overflow="fold")
    for name in ("captures", "time"):
        result.add_column(name, justify="right")
    for row in rows:
        figures = (
            "" if math.isnan(value) else words(value)
            for value, words in ((row.captures, "{:.4g}".format), (row.seconds, duration))
        )
        state = f"{row.state}: {row.reason}" if row.reason else row.state
        name = row.name.rpartition("-")[0]
        result.add_row(*map(escape, (name, listed(row.needed_by), state)), *figures)
    return result
