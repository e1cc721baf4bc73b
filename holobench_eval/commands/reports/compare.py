"""``holoeval compare``: what changed from one run to another, regressions first."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape
from rich.table import Table

from ...core.errors import UserError
from ..output import console as open_console


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
    from ...report.compare import compare as pair

    console = open_console()
    comparison = pair(a, b, metric, _pairs(displays))
    for title, sentence, rows in comparison.parts:
        console.print(f"\n{title}. {sentence}", markup=False, soft_wrap=True)
        if len(rows):
            table = Table(*map(escape, map(str, rows)))
            for row in rows.itertuples(index=False):
                table.add_row(*map(escape, row))
            console.print(table)
    if output is not None:
        for name, text in (("compare.md", comparison.markdown), ("compare.csv", comparison.csv)):
            write_atomically(output / name, text.encode())
            console.print(str(output / name), markup=False, soft_wrap=True)
    if fail_on_regression is not None:
        limit = f"{fail_on_regression:g} {comparison.rows['unit'][0]}".rstrip()
        rows = comparison.rows
        worse = rows[(rows["verdict"] == "worse") & (rows["difference"].abs() > fail_on_regression)]
        lost = comparison.unpaired[comparison.unpaired["run"] == "A"]
        for what, rows in ((f"worse by more than {limit}", worse), ("without scores that A has", lost)):
            if len(rows):
                named = "; ".join(rows["method"] + " on " + rows["display"])
                console.print(f"{what}: {named}", markup=False, soft_wrap=True)
        if len(worse) or len(lost):
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
