"""``holoeval bench``: how fast the package is, beside others' code or against another revision of itself."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.markup import escape
from rich.progress import Progress, TimeRemainingColumn
from rich.table import Table

from .output import console

HOUR = 3600.0  # s
COMPLETE, PART = Path("reports/performance"), Path(".benchmarks/part")  # so that a part never replaces the complete


def bench(
    only: Annotated[str | None, typer.Option(help="Benchmarks whose names hold this text.")] = None,
    output: Annotated[
        Path | None, typer.Option(help="Folder of the report, reports/performance; with --only, .benchmarks/part.")
    ] = None,
    against: Annotated[str | None, typer.Option(help="Compare the working tree with this git revision.")] = None,
) -> None:
    """Time the package beside others' code, or against a revision: propagations, steps, captures, metrics, cells."""
    from ..benchmarks import machine, report
    from ..benchmarks.measure import measure

    load = machine.load()
    if load is not None and load > machine.BUSY:
        print(f"holoeval: the machine is busy (load {load}): short calls will seem to take longer", file=sys.stderr)
    machine.few_processors()
    if against is not None:
        _compare(against, only)
        return
    with _progress(console()) as advance:
        measured = measure(only or "", advance)
    known = machine.describe(load, machine.load()) | {"missing": measured.missing, "faults": measured.faults}
    print(report.write(output or (COMPLETE if only is None else PART), measured.timings, known))
    for name, reason in measured.faults.items():
        print(f"could not be timed: {name}: {reason}")
    if measured.faults:
        raise typer.Exit(1)


@contextmanager
def _progress(screen: Console) -> Iterator[Callable[[str, float, float], None]]:
    """A bar that is told what is timed next, what is done and of how much."""
    columns = (*Progress.get_default_columns()[:-1], TimeRemainingColumn())
    # the speed is that since the beginning: one group waits for its preparation, another for its calls
    with Progress(*columns, console=screen, transient=True, speed_estimate_period=HOUR) as progress:
        task = progress.add_task("preparing", total=None)

        def advance(next_one: str, done: float, total: float) -> None:
            progress.update(task, description=escape(next_one), completed=done, total=total)

        yield advance


def _compare(revision: str, only: str | None) -> None:
    """Print a verdict for every case; exit code 1 if one is slower."""
    from ..benchmarks.against import COMPARED, MARGIN, against
    from ..benchmarks.suite import cases

    names = COMPARED if only is None else [case.name for case in cases(only)]
    screen = console()
    with _progress(screen) as advance:
        comparisons = against(revision, names, advance)
    title = f"working tree over {escape(revision)}"
    table = Table("", "ratio of times", "interval", "verdict", title=title, title_justify="left")
    for row in comparisons:
        interval = row.reason or f"{row.lower:.3f} to {row.upper:.3f}"
        table.add_row(escape(row.case), f"{row.ratio:.3f}", escape(interval), row.verdict)
    screen.print(table)
    screen.print(f"intervals: 99 % for all together; changes below {MARGIN - 1:.0%} are not counted", markup=False)
    if any(row.verdict == "slower" for row in comparisons):
        raise typer.Exit(1)
