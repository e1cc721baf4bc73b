"""``holoeval run``: from a config to its report.

One image on its way to a table row: ``study.plan`` makes it a cell, ``study.running.run`` has the cell's method solve
it, shows the phase on the cell's display, captures, registers and scores it, and writes one record; ``write_report``
makes the table from all records.
"""

from __future__ import annotations

import hashlib
import json
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from importlib import import_module
from pathlib import Path
from threading import Thread
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..core.errors import UserError, one_line
from ..core.installed import as_typed
from ..core.io import read_regular
from ..core.panels import is_small
from ..core.parts import divided, load_config
from ..core.yaml_source import LARGEST_BYTES
from . import options
from .output import console as open_console
from .output import write_report

if TYPE_CHECKING:
    from ..study.definition import Study
    from ..study.displays import Condition
    from ..study.executors import Executor

INTERRUPTED = 130


def run(
    config: options.Config,
    output: options.Output = None,
    methods: options.Methods = None,
    targets: options.Targets = None,
    limit: options.Limit = None,
    values: options.Values = None,
    executor: Annotated[
        str, typer.Option(help="Where to compute: serial, local (worker processes), slurm, address, or auto.")
    ] = "auto",
    workers: Annotated[int | None, typer.Option(help="Worker processes of the local executor, or SLURM jobs.")] = None,
    threads: options.Threads = None,
    address: Annotated[str | None, typer.Option(help="Of a running Dask scheduler, for --executor address.")] = None,
    device: options.Device = "auto",
    retry_failed: Annotated[bool, typer.Option("--retry-failed", help="Compute failed cells again.")] = False,
    retrain: Annotated[bool, options.RETRAIN] = False,
    train: Annotated[bool, typer.Option("--train/--no-train", help="Train what is not trained, or refuse it.")] = True,
    artifacts: options.Learned = options.ARTIFACTS,
) -> None:
    """Compute what is missing of a study and write its report. A stopped run goes on with the same command.

    A part of the study is run by its name behind that of the study, such as table3/table2, into a folder in that of the
    study. With --methods, --targets, --limit or --set, some of the study or a variant of it is run, and its report says
    so.
    """
    changes = options.changes_of(methods, targets, limit, values)
    with resumable():
        if changes or retrain or retry_failed or not _is_finished(config, output):
            from ..study.executors import begin

            begin(executor, workers, is_small(_panel(config)))
        from ..study.artifacts import Artifacts
        from ..study.config import load_study
        from ..study.plan import plan
        from ..study.running.progress import watching
        from ..study.running.run import run as compute
        from ..study.training import keep_training_records

        console = open_console()
        study = load_study(config, changes)
        named, where = _where(study, device, executor, workers, address)
        open_displays(study)
        folder, grid = options.output_folder(study, output), plan(study)
        learned = options.learned_folder(artifacts, grid)
        if word := replaced(study, folder):
            console.print(word, markup=False, soft_wrap=True)
        many = options.thread_count(threads, where.workers, study)
        how: dict[str, Any] = {"retry_failed": retry_failed, "retrain": retrain, "trains": train, "device": named}
        drawings = sheets(study, folder)
        beside = drawings if where.workers > 1 else []
        if where.workers > 1:  # meanwhile this process only waits
            Thread(target=import_module, args=("holobench_eval.report",), daemon=True).start()
        with watching(console) as watch:
            outcome = compute(study, grid, folder, where, watch, many, learned, drawings=beside, **how)
        keep_training_records(grid, Artifacts(learned), folder)
        draw_sheets(drawings, options.thread_count(threads, 1, study))
        write_report(console, study, outcome.records, folder, outcome.provenance)
        if study.parts and not changes:
            names = ", ".join(f"{as_typed(config)}/{name}" for name in study.parts)
            console.print(f"Its parts are studies of their own, run by name: {names}", markup=False, soft_wrap=True)
    if outcome.failed:
        console.print(f"[red]{outcome.failed} cell{'s' * (outcome.failed > 1)} failed[/red]", soft_wrap=True)
        reasons = f"reasons: {folder}/details.md, tracebacks: {folder}/records/*.log"
        console.print(reasons, markup=False, soft_wrap=True)
        raise typer.Exit(1)


def _panel(config: Path) -> tuple[int, int] | None:
    """The panel in a config that nobody has checked yet, without the libraries that check it; None if there is none."""
    try:
        rows, columns = load_config(config).data["display"]["panel"]
        return int(rows), int(columns)
    except (UserError, ValueError, TypeError, LookupError, ArithmeticError):
        return None


def _is_finished(config: Path, output: Path | None) -> bool:
    """Whether the last run of a config, as it stands, ended: there is probably nothing to compute."""
    try:
        file, part = divided(config)
        known = (output or options.RESULTS / file.stem / part) / "provenance.json"
        described = json.loads(read_regular(known, 2 * LARGEST_BYTES))
        text = hashlib.sha256(load_config(config).text.encode()).hexdigest()
        return bool(described["ended"] and described["config_sha256"] == text)
    except (UserError, OSError, ValueError, TypeError, LookupError):
        return False


def replaced(study: Study, folder: Path) -> str:
    """What to say where a folder has the report of another config, or of another part of this one; else nothing."""
    from ..study.changes import recorded
    from ..study.running import provenance

    before = provenance.read(folder)
    if not (folder / "report.md").is_file() or before.get("config_sha256") == provenance.text_digest(study.text):
        return ""
    earlier = recorded(before)
    other = f"was run with {earlier}" if earlier != study.changes and earlier else "is of another or an edited config"
    return f"{folder}: this run replaces the report there, which {other}; with another --output it is kept"


@contextmanager
def resumable() -> Iterator[None]:
    """Say of an interrupted computation how it goes on."""
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
    """Open and calibrate the real displays and the networks of a study, so that what is wrong is reported first."""
    from ..study.displays import displays
    from ..study.opening import open_display

    for display in displays(study).values():
        if display.real or display.network:
            open_display(display, study.seed)


def draw_stages(display: Condition, note: str, seed: int, output: Path) -> None:
    """Draw the stages of a display beside a report, unless they are there as this code draws them.

    note: how its panel was scaled; seed: of the study.
    """
    from ..core.hashing import digest
    from ..report.charts.sheet import VERSION, drawn_from, save_sheet
    from ..study.opening import simulated
    from ..study.versions import HARNESS

    path = output / "figures" / f"stages-{display.name}.png"
    identity = digest([display.digest, list(display.spec.shape), seed, HARNESS, VERSION])
    if drawn_from(path) != identity:
        save_sheet(simulated(display, seed), note, path, identity)


def sheets(study: Study, output: Path) -> list[partial[None]]:
    """What draws the stages of each display of a study, of many the first alone; networks and real ones have none."""
    from ..display import load_profile
    from ..report.statistics import FEWEST_DISPLAYS
    from ..study.displays import condition

    panel, folder, profiles = study.display.panel, study.folder, study.display.profiles
    return [
        partial(draw_stages, display, load_profile(source, folder).scaling_note(panel), study.seed, output)
        for source in (profiles[:1] if len(profiles) >= FEWEST_DISPLAYS else profiles)
        if not (display := condition(source, panel, folder)).network
    ]


def draw_sheets(drawings: list[partial[None]], threads: int) -> None:
    """Draw what no worker has drawn. A picture must not cost the report: what is wrong with one is printed."""
    import torch

    torch.set_num_threads(threads)
    for sheet in drawings:
        try:
            sheet()
        except Exception as error:
            print(f"holoeval: no stage sheet of {sheet.args[0].name}: {one_line(str(error))}", file=sys.stderr)
