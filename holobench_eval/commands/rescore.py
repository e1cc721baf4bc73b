"""``holoeval rescore``: fill the columns that a study lacks, from the captures it has kept."""

from __future__ import annotations

from typing import Annotated

import typer

from ..core.errors import UserError, suggest
from ..core.installed import as_typed
from ..core.panels import is_small
from .options import ARTIFACTS, Config, Output, Threads, planned, thread_count
from .output import console as open_console
from .output import write_report

Metrics = Annotated[list[str] | None, typer.Option("--metric", metavar="NAME", help="Only this one; may be repeated.")]


def rescore(config: Config, output: Output = None, metric: Metrics = None, threads: Threads = None) -> None:
    """Score kept captures by the metrics that their records lack. Nothing is solved, and no photograph is taken."""
    from ..study import executors
    from ..study.running.progress import watching
    from ..study.running.run import run as compute
    from ..study.store import Store

    console = open_console()
    grids = [*planned(config, output)]
    for name in metric or ():
        if name not in grids[0][2].metrics:
            raise UserError(f"--metric {name}: the study has no such metric; {suggest(name, grids[0][2].metrics)}")
    for study, folder, grid in grids:
        store, again = Store(folder), f"holoeval run {as_typed(study.config)}"
        if not store.folder.is_dir():
            raise UserError(f"{folder} has no captures; {again} takes them")
        if all(record["state"] == "missing" for record in store.load(grid)):  # an empty report would replace a good one
            changed = "the study or the code has changed"
            raise UserError(f"{folder}: no cell of this study has a record here ({changed}); {again} computes them")
    for study, folder, grid in reversed(grids):  # the first study's report has the answers of its parts
        wanted = tuple(name for name in metric or grid.metrics if name in grid.metrics)
        if not wanted:  # of a part that has none of these metrics; without any, all of it would be run
            continue
        real, panel = study.display.real, study.display.panel
        where = executors.Serial() if real else executors.executor("auto", None, is_small(panel))
        many = thread_count(threads, where.workers, study)
        with watching(console) as watch:
            outcome = compute(study, grid, folder, where, watch, many, ARTIFACTS, rescore=wanted)
        how = "without its record holoeval run photographs each again" if real else "holoeval run computes them"
        left = f"; {outcome.unscored} have no whole capture of their own kept, and {how}" * bool(outcome.unscored)
        console.print(f"{outcome.rescored} captures scored again, {outcome.solved} solved{left}")
        write_report(console, study, outcome.records, folder, outcome.provenance)
