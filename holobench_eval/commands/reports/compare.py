"""``holoeval compare``: what changed from one run to another, regressions first."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from ...core.errors import UserError
from ..output import console as open_console

if TYPE_CHECKING:
    from ...report.compare.page import Part


def compare(
    a: Annotated[Path, typer.Argument(metavar="A", help="The folder of a report, such as reports/table3.")],
    b: Annotated[Path, typer.Argument(metavar="B", help="The folder of another one; differences are B - A.")],
    displays: Annotated[
        list[str] | None, typer.Option(metavar="A=B", help="Pair a display of A with one of B; may be repeated.")
    ] = None,
    metric: Annotated[
        str | None, typer.Option(help="Score to compare, such as ssim_linear. [default: the first of both]")
    ] = None,
    output: Annotated[Path | None, typer.Option(help="Folder for compare.md and compare.csv.")] = None,
    fail_on_regression: Annotated[
        float | None,
        typer.Option(
            min=0,
            metavar="AMOUNT",
            help="Exit code 1 if a method's mean is worse by more (in dB, or the metric's unit), its interval clear of "
            "zero, which takes three clusters of targets, or if B lacks scores that A has.",
        ),
    ] = None,
) -> None:
    """Compare two reports cell by cell: of two commits, two benches, or a simulated and a real one."""
    from ...core.io import write_atomically
    from ...report.compare import page
    from ...report.compare.paired import compare as pair
    from ...report.compare.paired import read_run

    console = open_console()
    comparison = pair(read_run(a), read_run(b), metric, _pairs(displays))
    for part in page.parts(comparison):
        _print(console, part)
    if output is not None:
        for name, text in (("compare.md", page.markdown(comparison)), ("compare.csv", page.csv(comparison))):
            write_atomically(output / name, text.encode())
            console.print(str(output / name), markup=False, soft_wrap=True)
    if fail_on_regression is not None:
        limit = f"{fail_on_regression:g} {comparison.score.unit}".rstrip()
        worse = [f"{row.method} on {row.display}" for row in comparison.regressions(fail_on_regression)]
        lost = [f"{part.method} on {part.display}" for part in comparison.unpaired if part.run == "A"]
        for what, named in ((f"worse by more than {limit}", worse), ("without scores that A has", lost)):
            if named:
                console.print(f"{what}: {'; '.join(named)}", markup=False, soft_wrap=True)
        if worse or lost:
            raise typer.Exit(1)


def _pairs(displays: Sequence[str] | None) -> dict[str, str] | None:
    """``["a=b"]`` as ``{"a": "b"}``; None for none. UserError for anything else, and for a display named twice."""
    pairs: dict[str, str] = {}
    for text in displays or ():
        first, sign, second = text.partition("=")
        if not (first and sign and second):
            raise UserError(f"--displays {text}: expected a display of A and one of B, such as leto-2020=leto-aged")
        if first in pairs:
            raise UserError(f"--displays {text}: '{first}' is paired already; expected each display once")
        pairs[first] = second
    return pairs or None


def _print(console: Console, part: Part) -> None:
    console.print(f"\n{part.title}. {part.sentence}", markup=False, soft_wrap=True)
    if part.rows:
        table = Table(*map(escape, part.rows[0]))
        for row in part.rows:
            table.add_row(*map(escape, row.values()))
        console.print(table)
