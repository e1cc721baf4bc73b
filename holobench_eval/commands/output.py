"""What commands print: a console that fits its reader, and a study's report with its headline tables."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console, ConsoleOptions, RenderableType
from rich.markup import escape
from rich.padding import Padding
from rich.segment import Segment
from rich.table import Table

from ..core.errors import listed, printable

if TYPE_CHECKING:
    from ..report import Results
    from ..report.board import Board, Display
    from ..study.definition import Study

MOST_REASONS = 10  # that a terminal shows; details.md has all


class _Screen(Console):
    """A console that prints a question mark for each sign of a text that a terminal would obey, whoever wrote it."""

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterable[Segment]:
        """As rich does, which writes its own control codes in segments apart."""
        for segment in super().render(renderable, options):
            if segment.control or segment.text.isprintable():
                yield segment
            else:
                yield segment._replace(text="\n".join(map(printable, segment.text.split("\n"))))


def console() -> Console:
    """A console as wide as its terminal; wide enough for tables where there is none."""
    screen = _Screen(highlight=False)
    return screen if screen.is_terminal else _Screen(width=160, highlight=False)


def write_report(
    console: Console,
    study: Study,
    records: list[dict[str, object]],
    output: Path,
    known: dict[str, object],
    keep_pictures: bool = False,
) -> Results:
    """Write a study's report, print its headline tables, its answer and the reasons of holes, and return its numbers.

    known: its provenance; keep_pictures: see build_report.
    """
    from ..report import build_report
    from ..report.phrases import edited, uncovered

    written, results = build_report(study, records, output, known, keep_pictures)
    print_headline(console, results)
    print_answer(console, results)
    print_holes(console, results)
    for text in filter(None, [uncovered(records), edited(records)]):
        console.print(text, markup=False, soft_wrap=True)
    files = (written, written.with_suffix(".html"), output / "table.csv", output / "records.csv")
    if not output.name.startswith("."):  # of a command that leaves some of them elsewhere
        console.print("\n".join(map(str, files)), soft_wrap=True)
    return results


def print_headline(console: Console, results: Results) -> None:
    """Print the board of every display unless there are many, in 80 columns; and what is odd about phases."""
    from ..report.board import board
    from ..report.phrases import remarks
    from ..report.stories import many_displays

    drawn = board(results)
    for display in [] if many_displays.applies(results) else drawn.displays:
        console.print(board_of(drawn, display))
    for remark in remarks(results):
        console.print(remark, style="yellow", markup=False, soft_wrap=True)


def board_of(drawn: Board, display: Display) -> Table:
    """A display's board for a terminal; the report has the other columns. Only names are broken into lines."""
    from ..report.text import FILES, number

    results, score = drawn.results, drawn.results.headline
    table = Table(title=escape(f"{display.name}: {score.heading}"), title_justify="left")
    table.add_column("", no_wrap=True)
    table.add_column("method", overflow="fold")
    table.add_column(escape(f"{score.title} [{score.unit}]" if score.unit else score.title), no_wrap=True)
    if results.baseline:
        table.add_column(escape(f"against {results.baseline}"), overflow="fold")
    spends = results.study.measure != FILES and results.facts.spends
    if spends:
        table.add_column("photos", justify="right", no_wrap=True)
    for group, rows in display.groups:
        if len(display.groups) > 1:
            table.add_row("", f"[bold]{group}[/]")
        for row in rows:
            cells = [row.tier, ", ".join([row.label, *drawn.marks(row)]), score.number(row.score.mean)]
            if results.baseline:
                cells.append(score.estimate(row.test.estimate, signed=True) if row.test else "")
            cells += ["–" if row.photographs is None else number(row.photographs)] if spends else []
            table.add_row(*map(escape, cells))
    return table


def print_answer(console: Console, results: Results) -> None:
    """Print the answer to the question of a study.

    The tables alone do not give it: intervals of means overlap where the paired difference is clear, and a method that
    is worse than a constant image has a rank, too.
    """
    from ..report.stories import answer

    for sentence in answer(results):
        console.print(f"- {sentence}", markup=False)


def print_holes(console: Console, results: Results) -> None:
    """Print why cells have no score: a line for every reason, with the number of its cells and whose they are.

    Reasons that differ in numbers alone count as one.
    """
    groups: dict[tuple[str, str], list[tuple[str, str, str]]] = {}
    columns = ["label", "condition", "state", "reason"]
    for method, condition, state, reason in results.holes[columns].itertuples(index=False):
        alike = re.sub(r"\d+(?:\.\d+)?", "0", reason)
        groups.setdefault((state, alike), []).append((method, condition, reason))
    if not groups:
        return
    console.print(f"without a score: {len(results.holes)} of {len(results.frame)} cells")
    for (state, _), cells in list(groups.items())[:MOST_REASONS]:
        whose = listed(dict.fromkeys(f"{method} on {condition}" for method, condition, _ in cells))
        line = f"{len(cells)} {state} ({whose}): {cells[0][2] or 'no reason given'}"
        console.print(Padding(escape(line), (0, 0, 0, 2), expand=False))
    if len(groups) > MOST_REASONS:
        console.print(f"  and {len(groups) - MOST_REASONS} more reasons, in details.md")
