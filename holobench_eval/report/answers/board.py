"""The board as tables: a display a table, its groups one below the other."""

from __future__ import annotations

from collections.abc import Mapping

from ..board import GROUPS, Board, Display, Row
from ..facts import ORACLE
from ..markdown import Markdown, blocks, code, escape, heading, table_of
from ..phrases import verdict
from ..text import FILES, grouped, number, words

SIGNS = {"better": "", "worse": "", "not shown to differ": " (not shown)", "not tested": " (no test)"}


def board_table(board: Board) -> Markdown | None:
    """The board of every display, under its name where there are several."""
    many = len(board.displays) > 1
    parts: list[object] = []
    for display in board.displays:
        parts += [heading(display.name, 3)] * many + [display_table(board, display)]
    return blocks([*parts, _note(board)]) if board.displays else None


def display_table(board: Board, display: Display) -> Markdown | None:
    """The board of a display: a row a method, the name of its group above it."""
    has_panel_time = any(row.panel_time is not None for row in display.rows)
    lines = list[Mapping[str, object]]()
    for group, rows in display.groups:
        own = [_line(board, row, group, has_panel_time) for row in rows]
        if len(display.groups) > 1:
            lines.append(dict.fromkeys(own[0], "") | {"method": Markdown("**{}**").format(GROUPS[group])})
        lines += own
    return table_of(lines)


def _line(board: Board, row: Row, group: str, has_panel_time: bool) -> dict[str, object]:
    score, results = board.results.headline, board.results
    title, name = results.facts.of(row.label, "title"), code(row.label)
    named = Markdown(", ").join([Markdown("{} ({})").format(title, name) if title else row.label, *board.marks(row)])
    line: dict[str, object] = {"": row.tier, "method": named, score.heading: score.number(row.score.mean)}
    if results.baseline:
        against = "baseline" if row.label == results.baseline else "–"
        if row.test:
            sign = "" if group == ORACLE else SIGNS[verdict(score, row.test)]
            against = f"{score.estimate(row.test.estimate, signed=True)}{sign}"
        line[f"against {results.baseline}{score.brackets}"] = against
    line |= {each.title: each.number(value) for each, value in zip(board.beside, row.beside, strict=True)}
    costs = {"photographs": row.photographs} if results.facts.spends else {}
    costs |= {"panel time [frames]": row.panel_time} if has_panel_time else {}
    costs |= {"seconds": row.seconds, "memory [MiB]": row.memory} if results.study.measure != FILES else {}
    return line | {cost: number(value) for cost, value in costs.items()}


def _note(board: Board) -> Markdown:
    """What the letters are, and what a gray picture scores."""
    known = [(each.floor, each.name) for each in board.displays if each.floor is not None]
    floors = grouped((board.results.headline.with_unit(floor), name) for floor, name in known)
    gray = [f"{value} on {words(names)}" if len(floors) > 1 else value for value, names in floors.items()]
    floor = f" A gray picture scores {'; '.join(gray)}." if gray else ""
    letters = "A letter holds the methods of a group that no test tells from its best."
    return escape(f"{letters}{floor} Brackets: 95 % intervals.")
