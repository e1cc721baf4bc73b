"""``holoeval run``: from a config to its report.

One image on its way to a table row: ``study.plan`` makes it a cell, ``study.run`` has the cell's method solve it, shows
the phase on the cell's display, captures, registers and scores it, and writes one record; ``write_report`` makes the
table from all records.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .options import Config, Device, Learned, Output, Threads, is_small, output_folder, thread_count
from .output import console as open_console
from .output import write_report

if TYPE_CHECKING:
    from rich.console import Console

    from ..study.definition import Study
    from ..study.executors import Executor

INTERRUPTED = 130


def run(
    config: Config,
    output: Output = None,
    executor: Annotated[
        str, typer.Option(help="Where to compute: serial, local (worker processes), slurm, address, or auto.")
    ] = "auto",
    workers: Annotated[int | None, typer.Option(help="Worker processes of the local executor, or SLURM jobs.")] = None,
    threads: Threads = None,
    address: Annotated[str | None, typer.Option(help="Of a running Dask scheduler, for --executor address.")] = None,
    device: Device = "auto",
    retry_failed: Annotated[bool, typer.Option("--retry-failed", help="Compute failed cells again.")] = False,
    retime: Annotated[bool, typer.Option("--retime", help="Measure solving times again.")] = False,
    retrain: Annotated[bool, typer.Option("--retrain", help="Train again what the study's methods learn.")] = False,
    artifacts: Learned = Path("artifacts"),
) -> None:
    """Compute what is missing of a study, then write its report. A stopped run goes on with the same command."""
    with _resumable():
        from ..study.artifacts import Artifacts
        from ..study.config import load_study
        from ..study.plan import plan
        from ..study.progress import watching
        from ..study.run import run as compute
        from ..study.training import keep_training_records

        console, study = open_console(), load_study(config)
        device, where = _where(study, device, executor, workers, address)
        if study.display.real:
            open_displays(study)
        folder, grid = output_folder(study, output), plan(study)
        many = thread_count(threads, where.workers, study)
        again = {"retry_failed": retry_failed, "retime": retime, "retrain": retrain}
        with watching(console) as watch:
            outcome = compute(study, grid, folder, where, watch, many, artifacts, device=device, **again)
        keep_training_records(grid, Artifacts(artifacts), folder)
        draw_sheets(console, study, folder, thread_count(threads, 1, study))
        write_report(console, study, outcome.records, folder, outcome.provenance)
    if outcome.failed:
        console.print(f"[red]{outcome.failed} cell{'s' * (outcome.failed > 1)} failed[/red]", soft_wrap=True)
        console.print(f"reasons: {folder}/report.md, tracebacks: {folder}/records/*.log", markup=False, soft_wrap=True)
        raise typer.Exit(1)


@contextmanager
def _resumable() -> Iterator[None]:
    try:
        yield
    except KeyboardInterrupt:
        print("holoeval: stopped; what was computed is kept, resume with the same command", file=sys.stderr)
        raise typer.Exit(INTERRUPTED) from None


def _where(study: Study, device: str, executor: str, workers: int | None, address: str | None) -> tuple[str, Executor]:
    """The device by its name, and the executor. UserError: either is unknown, or not to be had."""
    from ..core.device import find, gpus
    from ..study import executors

    elsewhere = executor in executors.ELSEWHERE  # workers there look for their own devices
    device = device if elsewhere else str(find(device))
    shared = int(device.startswith("cuda")) if elsewhere else gpus(device)
    chosen = executors.executor(executor, workers, is_small(study.display.panel), address, shared)
    return device, executors.Serial() if study.display.real else chosen  # there is one real bench


def open_displays(study: Study) -> None:
    """Open and calibrate the displays of a study, so that what is wrong with a real one is reported first."""
    from ..study.displays import displays
    from ..study.opening import open_display

    for display in displays(study).values():
        open_display(display, study.seed)


def draw_sheets(console: Console, study: Study, output: Path, threads: int) -> None:
    """Draw the stages of every display of a study beside its report, where it is not there as this code draws it."""
    import torch

    from ..core.hashing import digest
    from ..display import load_profile
    from ..report.charts.sheet import drawn_from, save_sheet
    from ..study.displays import condition
    from ..study.opening import simulated
    from ..study.versions import HARNESS

    for source in study.display.profiles:  # learned and real displays have no stages
        display = condition(source, study.display.panel, study.folder)
        path = output / "figures" / f"stages-{display.name}.png"
        identity = digest([display.digest, list(display.spec.shape), study.seed, HARNESS])
        if drawn_from(path) == identity:
            continue
        console.print(f"drawing the stages of {display.name}", markup=False)
        torch.set_num_threads(threads)
        note = load_profile(source, study.folder).scaling_note(study.display.panel)
        try:
            save_sheet(simulated(display, study.seed), note, path, identity)
        except Exception as error:  # a picture must not cost the report
            print(f"holoeval: no stage sheet of {display.name}: {error}", file=sys.stderr)
