"""``holoeval bench``: how fast the package is, beside others' code or against another revision of itself."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape
from rich.progress import Progress, TimeRemainingColumn
from rich.table import Table

from .output import console

COMPLETE, PART = Path("reports/performance"), Path(".benchmarks/part")  # so that a part never replaces the complete


def bench(
    only: Annotated[str | None, typer.Option(help="Benchmarks whose names hold this text.")] = None,
    output: Annotated[
        Path | None, typer.Option(help="Folder of the report, reports/performance; with --only, .benchmarks/part.")
    ] = None,
    against: Annotated[str | None, typer.Option(help="Compare the working tree with this git revision.")] = None,
) -> None:
    """Time propagations, gradient steps, captures, metrics and cells beside others' code, or against a revision."""
    from ..benchmarks import machine, report, suite

    load = machine.load()
    if load is not None and load > machine.BUSY:
        print(f"holoeval: the machine is busy (load {load}): short calls will seem to take longer", file=sys.stderr)
    if against is not None:
        _compare(against, only)
        return
    timings, complete = suite.measure(only)
    before = machine.describe(load)
    compared = report.beside_others(timings)
    timings = [replace(row, memory_bytes=suite.peak_memory(row)) if row.group in compared else row for row in timings]
    print(report.write(output or (COMPLETE if only is None else PART), timings, before))
    if not complete:
        print("not all could be timed; what pytest printed says why")
        raise typer.Exit(1)


def _compare(revision: str, only: str | None) -> None:
    """Print a verdict for every case; exit code 1 if one is slower."""
    from ..benchmarks.against import COMPARED, MARGIN, against
    from ..benchmarks.suite import names

    cases = COMPARED if only is None else names(only)
    screen = console()
    columns = (*Progress.get_default_columns()[:-1], TimeRemainingColumn())
    with Progress(*columns, console=screen, transient=True) as progress:
        task = progress.add_task("timing", total=None)

        def advance(case: str, done: int, total: int) -> None:
            progress.update(task, description=escape(case), completed=done, total=total)

        comparisons = against(revision, cases, advance)
    title = f"working tree over {escape(revision)}"
    table = Table("", "ratio of times", "interval", "verdict", title=title, title_justify="left")
    for row in comparisons:
        interval = row.reason or f"{row.lower:.3f} to {row.upper:.3f}"
        table.add_row(escape(row.case), f"{row.ratio:.3f}", escape(interval), row.verdict)
    screen.print(table)
    screen.print(f"intervals: 99 % for all together; changes below {MARGIN - 1:.0%} are not counted", markup=False)
    if any(row.verdict == "slower" for row in comparisons):
        raise typer.Exit(1)
