"""What commands print: a console that fits its reader, and a study's report with its headline tables."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.markup import escape
from rich.table import Table

if TYPE_CHECKING:
    from ..report import Results
    from ..study.definition import Study


def console() -> Console:
    """A console as wide as its terminal; wide enough for tables where there is none."""
    screen = Console()
    return screen if screen.is_terminal else Console(width=160)


def write_report(
    console: Console,
    study: Study,
    records: list[dict[str, object]],
    output: Path,
    known: dict[str, object],
    keep_pictures: bool = False,
) -> Results:
    """Write a study's report, print its headline tables and return its numbers.

    known: its provenance; keep_pictures: see build_report.
    """
    from ..report import build_report

    written, results = build_report(study, records, output, known, keep_pictures)
    print_headline(console, results)
    files = (written, written.with_suffix(".html"), output / "table.csv", output / "records.csv")
    console.print("\n".join(map(str, files)), highlight=False, soft_wrap=True)
    return results


def print_headline(console: Console, results: Results) -> None:
    """Print the headline table of every condition."""
    from ..report import headline_rows

    for condition in results.conditions:
        headings, rows = headline_rows(results, condition)
        table = Table(*map(escape, headings), title=escape(condition), title_justify="left")
        for row in rows:
            table.add_row(*map(escape, row))
        console.print(table)
