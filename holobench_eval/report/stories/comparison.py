"""Comparison of methods: what is best on each display, and is what the question names better than the baseline?"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from ...core.errors import listed
from ...study.folders.files import remedies
from ..board import Board, Display, Row, board
from ..facts import CALIBRATED, ONLINE, OPEN_LOOP, ORACLE
from ..markdown import Markdown, blocks, code, heading, table_of
from ..phrases import difference, verdict
from ..results import Results
from ..statistics import SIGNIFICANCE
from ..story import Blocks, Figures, Part, Report, is_many, subjects
from ..text import FILES, grouped, number, words

ORDER = 100
QUESTION = "Which method gives the better picture, and by how much?"
NAMED = 3  # methods of one letter
LISTED = 10  # methods, or targets of all of them
LISTED_EACH = 3  # targets of a method
OTHER = "{baseline}"  # the place of the baseline's name, which a verdict says once
MOST_ROWS = 30  # of boards, one below the other
UNSHOWN = "not shown to differ"
SIGNS = {"better": "", "worse": "", UNSHOWN: "°", "not tested": " (no test)"}


def applies(results: Results) -> bool:
    """A comparison of methods is what any study is."""
    return True


def verdicts(results: Results) -> Iterator[str]:
    """One a display, then which methods lack targets."""
    drawn = board(results).displays
    for display in drawn:
        yield of_display(results, display, f"{display.name}: " * (len(drawn) > 1))
    yield lacking(results)


def of_display(results: Results, display: Display, begin: str = "") -> str:
    """Who leads without a camera at the scored picture, with one, and what becomes of the methods of the question."""
    complete = [
        rows for _, group in display.groups if (rows := [row for row in group if row.scored == len(results.targets)])
    ]
    groups = {(rows[0].category, rows[0].frames > 1): rows for rows in complete}
    single = [rows for (category, several), rows in groups.items() if category not in (ONLINE, ORACLE) and not several]
    first = max(single, key=lambda rows: results.headline.sign * rows[0].score.mean, default=[])
    blind = [] if first is groups.get((OPEN_LOOP, False)) else groups.get((OPEN_LOOP, False), [])
    named, parts = list[str](), list[str]()
    for rows, where in (
        (first, _among(results, first)),
        (blind if first is groups.get((CALIBRATED, False)) else [], "without a camera "),
        (groups.get((OPEN_LOOP, True), []), "with several frames "),
        (groups.get((ONLINE, False), []), "with photographs of the picture itself "),
    ):
        if rows:
            tied = [row.label for row in rows if row.tier == "A"][:NAMED] or [rows[0].label]
            named += tied
            parts.append(f"{where}{_leads(results, rows[0], tied)}")
    for row in display.rows:
        if row.test and row.label in subjects(results) and row.label not in named:
            margin = published(results, row.label, display.name)
            known = "" if margin is None else f" (published {results.headline.with_unit(margin, signed=True)})"
            parts.append(f"{row.label} {_against(results, row)}{known}")
    text = f"{begin}{'; '.join(parts)}." if parts else ""
    return text.replace(OTHER, f" against {results.baseline}", 1).replace(OTHER, "")


def _among(results: Results, rivals: list[Row]) -> str:
    """Among whom the best row leads, where the baseline was given more of the camera or the display and is better."""
    test = rivals[0].test if rivals else None
    if test is None or not results.headline.better(0.0, test.estimate.mean):
        return ""
    knows = results.category(test.first) == ORACLE
    return "without knowing the display " if knows else "without photographs of the picture itself "


def _leads(results: Results, row: Row, tied: list[str]) -> str:
    """``a and b lead, not told apart (20.05 dB), +3.00 dB [+2.80, +3.20], for 40 photographs``."""
    apart = ", not told apart" * (len(tied) > 1)
    gained = f", {_against(results, row)}" if row.test else ""
    cost = f", for {row.camera.replace(' ', ' photographs ', 1)}" if row.photographs else ""
    mean = results.headline.with_unit(row.score.mean)
    return f"{words(tied)} lead{'s' * (len(tied) == 1)}{apart} ({mean}){gained}{cost}"


def _against(results: Results, row: Row) -> str:
    """``+1.30 dB [+0.43, +2.17]``, what it is the difference to, and whether that is shown."""
    assert row.test is not None
    told, mean = verdict(results.headline, row.test), row.test.estimate.mean
    if told == UNSHOWN:  # an interval of one comparison could contradict the test of all
        return f"{results.headline.with_unit(mean, signed=True)}{OTHER}, not shown to differ"
    return f"{difference(results.headline, row.test.estimate)}{OTHER}{', untested' * (told == 'not tested')}"


def published(results: Results, label: str, condition: str) -> float | None:
    """The margin of two published figures beside a display, where a method and the baseline have one."""
    names, metric = (label, str(results.baseline)), results.headline.metric
    own, other = (results.facts.published(name, condition).get(metric) for name in names)
    return None if own is None or other is None else own - other


def table(board: Board) -> Markdown | None:
    """The board of each display; of more rows than a reader takes in, a row a method and a column a display."""
    count = sum(len(display.rows) for display in board.displays)
    drawn = boards(board) if count <= MOST_ROWS else [_matrix(board)]
    return blocks([*drawn, legend(board)]) if board.displays else None


def boards(board: Board) -> list[object]:
    """The board of each display, under its name where there are several: a row a method, its group above it."""
    parts = list[object]()
    for display in board.displays:
        lines = list[Mapping[str, object]]()
        for group, rows in display.groups:
            own = [_line(board, display, row) for row in rows]
            if len(display.groups) > 1:
                lines.append(dict.fromkeys(own[0], "") | {"method": Markdown("**{}**").format(group)})
            lines += own
        parts += [heading(display.name, 3)] * (len(board.displays) > 1) + [table_of(lines)]
    return parts


def legend(board: Board) -> str:
    """What letters, marks and brackets of a board are, and what a gray picture scores."""
    results, rows = board.results, [row for each in board.displays for row in each.rows]
    floors = [(each.floor, each.name) for each in board.displays if each.floor is not None]
    known = grouped((results.headline.with_unit(floor), name) for floor, name in floors)
    gray = [f"{value} on {words(names)}" if len(known) > 1 else value for value, names in known.items()]
    texts = ["Methods of a group with one letter cannot be told apart."] * any(row.tier for row in rows)
    if any(row.test and verdict(results.headline, row.test) == UNSHOWN for row in rows):
        count = sum(not np.isnan(test.p) for test in results.tests.values())
        texts.append(f"°: {UNSHOWN} (p ≥ {SIGNIFICANCE:g}, adjusted for {count} comparisons).")
    texts += ["*: no better than gray."] * any("no better than gray" in row.marks for row in rows)
    texts += [f"A gray picture scores {'; '.join(gray)}."] * bool(gray)
    return " ".join([*texts, "Brackets: 95 % intervals."])


def _matrix(board: Board) -> Markdown | None:
    """A row a method, those of most displays and largest mean difference first, within their group."""
    results, score = board.results, board.results.headline
    groups = grouped((name, row) for display in board.displays for name, rows in display.groups for row in rows)
    lines, known = list[dict[str, object]](), {(d.name, row.label): row for d in board.displays for row in d.rows}
    for name, rows in groups.items():
        own = grouped((row.label, row.test.estimate.mean if row.test else 0.0) for row in rows)
        ranked = sorted(own, key=lambda label: (-len(own[label]), -score.sign * np.mean(own[label])))
        for label in ranked:
            first = next(row for row in rows if row.label == label)
            line: dict[str, object] = {"method": _name(board, first)}
            line |= {"photographs": first.camera} if results.facts.spends else {}
            for display in board.displays:
                row = known.get((display.name, label))
                line[f"{display.name}{score.brackets}"] = _cell(board, row) if row else "–"
            if len(groups) > 1 and label == ranked[0]:
                lines.append(dict.fromkeys(line, "") | {"method": Markdown("**{}**").format(name)})
            lines.append(line)
    return table_of(lines)


def _cell(board: Board, row: Row) -> str:
    """``22.46 (+3.40)``, with the mark of a difference that is not shown."""
    score = board.results.headline
    gained = f" ({score.number(row.test.estimate.mean, signed=True)}{_sign(board, row)})" if row.test else ""
    return f"{score.number(row.score.mean)}{gained}{'*' * ('no better than gray' in row.marks)}"


def _sign(board: Board, row: Row) -> str:
    known = row.test and row.category != ORACLE
    return SIGNS[verdict(board.results.headline, row.test)] if known and row.test else ""


def _name(board: Board, row: Row) -> Markdown | str:
    """The name of a row for people, the code name behind it."""
    title = board.results.facts.of(row.label, "title")
    return Markdown("{} ({})").format(title, code(row.label)) if title else row.label


def _line(board: Board, display: Display, row: Row) -> dict[str, object]:
    score, results = board.results.headline, board.results
    line = {"": row.tier, "method": Markdown(", ").join([_name(board, row), *board.marks(row)])}
    line[score.heading] = score.number(row.score.mean)
    if results.baseline:
        against = "baseline" if row.label == results.baseline else "–"
        if row.test:
            against = f"{score.estimate(row.test.estimate, signed=True)}{_sign(board, row)}"
        line[f"against {results.baseline}{score.brackets}"] = against
    line |= {each.title: each.number(value) for each, value in zip(board.beside, row.beside, strict=True)}
    costs: dict[str, object] = {"photographs": row.camera} if results.facts.spends else {}
    if any(row.panel_time is not None for row in display.rows):
        costs["panel time [frames]"] = number(row.panel_time)
    if results.study.measure != FILES:
        costs |= {"processor seconds": number(row.seconds), "memory [MiB]": number(row.memory)}
    return line | costs


def lacking(results: Results) -> str:
    """Who lacks which targets, and what to do about it; empty where every method has a score for every target."""
    pairs = [(label, condition) for condition in results.conditions for label in results.methods(condition)]
    missing = {pair: np.array(results.targets)[np.isnan(results.values(*pair))].tolist() for pair in pairs}
    lacks = {pair: names for pair, names in missing.items() if names}
    if not lacks:
        return ""
    ranked, several, total = len(pairs) - len(lacks), len(results.conditions) > 1, len(results.targets)
    who = list[str]()
    for (label, condition), names in lacks.items():
        some = f"{len(names)} of {total} targets ({_first(names, LISTED_EACH)})"
        of_all = f"all {total} targets" if total > 1 else "the target"
        where = f" on {condition}" * several
        who.append(f"{label}{where} lacks {of_all if len(names) == total else some}")
    have = "1 method that has every target is" if ranked == 1 else f"{ranked} methods that have every target are"
    state = f"Only the {have} ranked" if ranked else "No method is ranked, since none has every target"
    common = _in_common(results, {label for label, _ in lacks}) if results.study.measure == FILES else ""
    return f"{state}: {_first(who, LISTED)}. {_remedy(results, list(lacks.values()))}{common}"


def _in_common(results: Results, lacks: set[str]) -> str:
    """How given photographs of two methods differ on the targets that both have, where one of them lacks some."""
    display, total = results.conditions[0], len(results.targets)
    labels = sorted(results.methods(display), key=lacks.__contains__)
    first = results.baseline or labels[0]
    parts = []
    for label in labels:
        if label != first and {label, first} & lacks:
            both = results.estimate(results.values(label, display) - results.values(first, display))
            parts += [f"{label} {difference(results.headline, both)} on {both.n} of {total}"] if both.n else []
    return f" Against {first}, on the targets that both have: {_first(parts, LISTED)}." if parts else ""


def _remedy(results: Results, lacks: list[list[str]]) -> str:
    """How all of them are ranked, or without some targets all that have any score."""
    some = [names for names in lacks if len(names) < len(results.targets)]
    away = [name for name in results.targets if any(name in names for names in some)]
    left, who = len(results.targets) - len(away), "all" if len(some) == len(lacks) else "all that have any score"
    if results.study.measure == FILES:
        holes = results.holes[["state", "label", "target", "reason"]].astype(str)
        way = remedies(holes.itertuples(index=False, name=None))
        moved = f"move the targets and captures of {_first(away, LISTED)} away"
        fewer = f"{moved} and rank {who} by the {left} target{'s' * (left > 1)} left"
    else:
        way = "Mend what the reasons in details.md say and run the same command again."
        fewer = f"name the other {left} targets with --targets to rank {who} by these"
    return f"{way[:-1]}, or {fewer}." if away and left else way


def _first(names: list[str], most: int) -> str:
    more = len(names) - most
    return f"{listed(names[:most])}{f' and {more} more' if more > 0 else ''}"


def _boards(report: Report, _: Figures) -> Blocks:
    drawn = board(report.results)
    return [heading("Boards"), *boards(drawn), legend(drawn)]


def _has_matrix(report: Report) -> bool:
    shown = board(report.results).displays
    return not is_many(report.results) and sum(len(display.rows) for display in shown) > MOST_ROWS


PARTS = (Part(8, _boards, applies=_has_matrix, details=True),)
