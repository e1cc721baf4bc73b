"""The command line: ``holoeval COMMAND``. Heavy imports wait until a command needs them."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..core.errors import UserError
from . import bench, capture
from .output import console as console_for_people
from .output import write_report

if TYPE_CHECKING:
    from rich.console import Console

    from ..study.definition import Study

INTERRUPTED = 130
LARGE_PANEL = 512 * 1024
"""Pixels."""

app = typer.Typer(
    name="holoeval",
    help="Compare phase-retrieval methods for holographic displays on simulated, imperfect benches.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)

capture.add_to(app)
app.command("bench")(bench.bench)

Config = Annotated[Path, typer.Argument(metavar="CONFIG", help="A study, such as configs/table3.yaml.")]
Output = Annotated[Path | None, typer.Option(help="Output folder. [default: reports/<name of the config>]")]
Threads = Annotated[int | None, typer.Option(min=1, help="Torch threads of a worker.")]
Workers = Annotated[int | None, typer.Option(help="Worker processes of the local executor, or SLURM jobs.")]
Where = Annotated[
    str, typer.Option(help="Where to compute: serial, local (worker processes), slurm, address, or auto.")
]
Address = Annotated[str | None, typer.Option(help="Of a running Dask scheduler, for --executor address.")]
Device = Annotated[str, typer.Option(help="Where torch computes: cpu, cuda, cuda:N, or auto, a GPU if it finds one.")]
Learned = Annotated[Path, typer.Option(help="Folder of what trained methods learned.")]


def main() -> None:
    """Entry point: bad input, and files that cannot be read or written, are one line on stderr and exit code 2."""
    try:
        app()
    except (UserError, OSError) as error:
        print(f"holoeval: {' '.join(str(error).split())}", file=sys.stderr)
        sys.exit(2)


def _output(study: Study, output: Path | None) -> Path:
    return output or Path("reports") / study.name


def _small(study: Study) -> bool:
    panel = study.display.panel
    return panel is not None and panel[0] * panel[1] < LARGE_PANEL


def _threads(threads: int | None, workers: int, study: Study) -> int:
    """Torch threads of a worker: as asked for, else one, or all for a single worker on large panels.

    Transforms of small panels gain less than twofold from a second thread, and lose tenfold and more (measured) when
    another program wants the core, since the threads wait for each other after every operation.
    """
    import torch

    return threads or (1 if workers > 1 or _small(study) else torch.get_num_threads())


@app.command()
def run(
    config: Config,
    output: Output = None,
    executor: Where = "auto",
    workers: Workers = None,
    threads: Threads = None,
    address: Address = None,
    device: Device = "auto",
    retry_failed: Annotated[bool, typer.Option("--retry-failed", help="Compute failed cells again.")] = False,
    retime: Annotated[bool, typer.Option("--retime", help="Measure solving times again.")] = False,
    retrain: Annotated[bool, typer.Option("--retrain", help="Train again what the study's methods learn.")] = False,
    artifacts: Learned = Path("artifacts"),
) -> None:
    """Compute what is missing of a study, then write its report. A stopped run goes on with the same command."""
    again = {"retry_failed": retry_failed, "retime": retime, "retrain": retrain}
    try:
        failed = _run(config, output, (executor, workers, address), threads, artifacts, again, device)
    except KeyboardInterrupt:
        print("holoeval: stopped; what was computed is kept, resume with the same command", file=sys.stderr)
        raise typer.Exit(INTERRUPTED) from None
    raise typer.Exit(1 if failed else 0)


def _run(
    config: Path,
    output: Path | None,
    where: tuple[str, int | None, str | None],
    threads: int | None,
    artifacts: Path,
    again: dict[str, bool],
    device: str,
) -> int:
    """Run, report, and give the number of failed cells. where: executor, workers and address."""
    from ..core.device import find, gpus
    from ..study import executors, plan, progress
    from ..study.artifacts import Artifacts
    from ..study.config import load_study
    from ..study.run import run as compute
    from ..study.training import keep_training_records

    console, study = console_for_people(), load_study(config)
    name, workers, address = where
    elsewhere = name in executors.ELSEWHERE
    device = device if elsewhere else str(find(device))
    shared = int(device.startswith("cuda")) if elsewhere else gpus(device)
    wanted = executors.executor(name, workers, _small(study), address, shared)
    chosen = executors.Serial() if study.display.real else wanted  # there is one bench
    if study.display.real:
        _prepare_bench(study)
    folder, grid, many = _output(study, output), plan.plan(study), _threads(threads, chosen.workers, study)
    with progress.watching(console) as watch:
        outcome = compute(study, grid, folder, chosen, watch, many, artifacts, **again, device=device)
    keep_training_records(grid, Artifacts(artifacts), folder)
    _sheets(console, study, folder, _threads(threads, 1, study))
    write_report(console, study, outcome.records, folder, outcome.provenance)
    if outcome.failed:
        console.print(f"[red]{outcome.failed} cell{'s' * (outcome.failed > 1)} failed[/red]", soft_wrap=True)
        console.print(f"reasons: {folder}/report.md, tracebacks: {folder}/records/*.log", markup=False, soft_wrap=True)
    return outcome.failed


def _prepare_bench(study: Study) -> None:
    """Open a real bench before anything is computed, so that what is wrong with it is told first."""
    from ..study.displays import displays
    from ..study.opening import open_display

    for place in displays(study).values():
        _ = open_display(place, study.seed)


def _sheets(console: Console, study: Study, output: Path, threads: int) -> None:
    """Draw the stages of every display of a study beside its report, where it is not there as this code draws it."""
    import torch

    from ..core.hashing import digest
    from ..display import load_profile
    from ..report.charts.sheet import drawn_from, save_sheet
    from ..study.displays import condition
    from ..study.opening import simulated
    from ..study.versions import HARNESS

    for source in study.display.profiles:  # learned and real displays have no stages
        place = condition(source, study.display.panel, study.folder)
        path = output / "figures" / f"stages-{place.name}.png"
        wanted = digest([place.digest, list(place.spec.shape), study.seed, HARNESS])
        if drawn_from(path) != wanted:
            console.print(f"drawing the stages of {place.name}", markup=False)
            torch.set_num_threads(threads)
            note = load_profile(source, study.folder).scaling_note(study.display.panel)
            try:
                save_sheet(simulated(place, study.seed), note, path, wanted)
            except Exception as error:  # a picture must not cost the report
                print(f"holoeval: no stage sheet of {place.name}: {error}", file=sys.stderr)


@app.command()
def plan(
    config: Config,
    output: Output = None,
    threads: Threads = None,
    device: Device = "auto",
    artifacts: Learned = Path("artifacts"),
) -> None:
    """Show what a study would compute, and what of it is done; compute nothing."""
    from ..core.device import find, gpu_name, gpus
    from ..study import executors
    from ..study import plan as planning
    from ..study.artifacts import Artifacts
    from ..study.config import load_study
    from ..study.store import Store
    from .preview import preview, table, training_table, trainings

    console, study = console_for_people(), load_study(config)
    folder, workers = _output(study, output), executors.executor("auto", None, _small(study), gpus=gpus(device)).workers
    grid = planning.plan(study)
    many = _threads(threads, workers, study)
    rows = preview(study, grid, Store(folder), many, workers, gpu_name(find(device)))
    console.print(table(study, rows))
    if needed := trainings(grid, Artifacts(artifacts)):
        console.print(training_table(needed))
    console.print(f"output folder: {folder}", highlight=False, soft_wrap=True)


@app.command()
def report(config: Config, output: Output = None) -> None:
    """Write the report of a study again from its records."""
    from ..study import plan as planning
    from ..study import provenance
    from ..study.config import load_study
    from ..study.store import Store

    study = load_study(config)
    folder = _output(study, output)
    store = Store(folder)
    if not store.folder.is_dir():
        raise UserError(f"{folder}: no records in this folder; holoeval run {config} makes them")
    records = store.load(planning.plan(study))
    if all(record["state"] == "missing" for record in records):
        changed = "the study, the code or the metrics that this machine can compute have changed"
        again = f"holoeval run {config} --output {folder}"
        raise UserError(f"{folder}: no cell of this study has a record here ({changed}); {again} computes them")
    write_report(console_for_people(), study, records, folder, provenance.read(folder))


@app.command("list")
def list_(
    kind: Annotated[str | None, typer.Argument(help="methods, datasets, profiles or metrics; all without.")] = None,
) -> None:
    """List what a config may name."""
    from rich.markup import escape
    from rich.table import Table

    from ..core.errors import suggest
    from .listing import KINDS

    if kind is not None and kind not in KINDS:
        raise UserError(f"unknown kind '{kind}'; {suggest(kind, KINDS)}")
    console = console_for_people()
    for name in [kind] if kind else KINDS:
        table = Table(title=name, title_justify="left", show_header=False)
        for entry, text in KINDS[name]():
            table.add_row(entry, escape(text))
        console.print(table)


@app.command("new-method")
def new_method(
    name: Annotated[str, typer.Argument(help="Lower-case words, such as my_method.")],
    folder: Annotated[Path, typer.Option(help="Where to write NAME.py and test_NAME.py.")] = Path(),
) -> None:
    """Write a method that works, to be changed, and its test."""
    from .scaffold import new_method as write

    method, test, named = write(name, folder)
    print(f"{method}\n{test}\nnext: pytest {test} (pip install pytest brings it); name it in a config as '{named}'")


@app.command()
def check(folder: Annotated[Path, typer.Argument(help="A folder of reports.")] = Path("reports")) -> None:
    """Check that committed reports still follow from their records, configs and profiles."""
    from .report_check import check as problems_in

    reports, problems = problems_in(folder)
    for problem in problems:
        print(problem)
    print(f"{reports} report{'s' * (reports > 1)}, {len(problems)} problem{'s' * (len(problems) != 1)}")
    if problems:
        raise typer.Exit(1)


@app.command()
def show(
    profile: Annotated[str, typer.Argument(help="A display profile: its name or its file.")],
    panel: Annotated[tuple[int, int] | None, typer.Option(help="Rows and columns in pixels.")] = None,
    output: Annotated[Path | None, typer.Option(help="Picture to write.")] = None,
) -> None:
    """Draw what a display does to a hologram, stage by stage, and list its effects."""
    import torch
    from rich.markup import escape
    from rich.table import Table

    from ..report.charts.sheet import draw_sheet
    from .listing import effects

    if panel is None or panel[0] * panel[1] < LARGE_PANEL:
        torch.set_num_threads(1)  # see _threads
    path, table = draw_sheet(profile, panel, output), Table(title=f"effects of {profile}", title_justify="left")
    for heading in ("effect", "", "parametric model"):
        table.add_column(heading)
    for name, text, modelled in effects(profile):
        table.add_row(name, escape(text), "has it" if modelled else "lacks it")
    console_for_people().print(table)
    print(path)


@app.command()
def conformance() -> None:
    """Check the propagators against direct integration, and registration over random poses of a camera."""
    from ..testing.propagation_conformance import main as check_optics
    from ..testing.registration_conformance import main as check_registration

    raise typer.Exit(max(check_optics(), check_registration()))


@app.command()
def calibrate(profile: Annotated[str, typer.Argument(help="A display profile: its name or its file.")]) -> None:
    """Fit the free parameters of a profile to published figures; a few minutes."""
    from .calibration import main as fit

    fit(profile)
