"""The board as tables: a display a table, its groups one below the other."""

from __future__ import annotations

from ..data.board import GROUPS, Board, Display, Row
from ..data.layout import ORACLE
from ..data.phrases import verdict
from ..data.text import FILES, grouped, number, words
from ..markdown import Markdown, blocks, code, escape, heading, table

PANEL_TIME, MEMORY = "panel time [frames]", "memory [MiB]"
SIGNS = {"better": "", "worse": "", "not shown to differ": " (not shown)", "not tested": " (no test)"}


def board_table(board: Board) -> Markdown | None:
    """The board of every display, under its name where there are several."""
    many = len(board.displays) > 1
    parts: list[object] = []
    for display in board.displays:
        parts += [heading(display.name, 3)] * many + [display_table(board, display)]
    return blocks([*parts, _note(board)]) if board.displays else None


def display_table(board: Board, display: Display) -> Markdown:
    """The board of a display: a row a method, the name of its group above it."""
    score, layout = board.results.headline, board.results.layout
    columns = ["", "method", score.heading]
    columns += [f"against {layout.baseline}{score.brackets}"] * bool(layout.baseline)
    columns += [each.name for each in board.beside]
    costs = ["photographs"] * layout.spends_captures
    costs += [PANEL_TIME] * any(row.panel_time is not None for row in display.rows)
    costs += ["seconds", MEMORY] * (layout.measure != FILES)
    lines: list[list[object]] = []
    for group, rows in display.groups:
        name = Markdown("**{}**").format(GROUPS[group])
        blank = [""] * (len(columns) + len(costs) - 2)
        lines += [["", name, *blank]] if len(display.groups) > 1 else []
        lines += [_line(board, row, group, bool(layout.baseline), costs) for row in rows]
    return table([*columns, *costs], lines)


def _line(board: Board, row: Row, group: str, tested: bool, costs: list[str]) -> list[object]:
    score, results = board.results.headline, board.results
    title, name = results.layout.titles.get(row.label), code(row.label)
    named = Markdown(", ").join([Markdown("{} ({})").format(title, name) if title else row.label, *board.marks(row)])
    line: list[object] = [row.tier, named, score.number(row.score.mean)]
    if tested and row.test:
        sign = "" if group == ORACLE else SIGNS[verdict(score, row.test)]
        line.append(f"{score.estimate(row.test.estimate, signed=True)}{sign}")
    elif tested:
        line.append("baseline" if row.label == results.layout.baseline else "–")
    line += [each.number(value) for each, value in zip(board.beside, row.beside, strict=True)]
    known = {"photographs": row.photographs, PANEL_TIME: row.panel_time, "seconds": row.seconds, MEMORY: row.memory}
    return line + [number(known[cost]) for cost in costs]


def _note(board: Board) -> Markdown:
    """What the letters are, and what a gray picture scores."""
    known = [(each.floor, each.name) for each in board.displays if each.floor is not None]
    floors = grouped((board.results.headline.with_unit(floor), name) for floor, name in known)
    gray = [f"{value} on {words(names)}" if len(floors) > 1 else value for value, names in floors.items()]
    floor = f" A gray picture scores {'; '.join(gray)}." if gray else ""
    letters = "A letter holds the methods of a group that no test tells from its best."
    return escape(f"{letters}{floor} Brackets: 95 % intervals.")
