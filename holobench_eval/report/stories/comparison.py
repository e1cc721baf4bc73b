"""Comparison of methods: what is best on each display, and is what the question names better than the baseline?"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from ...core.errors import listed
from ...study.folders.files import remedies
from ..board import Board, Display, Row, board
from ..charts import paired
from ..facts import CALIBRATED, ONLINE, OPEN_LOOP, ORACLE
from ..markdown import Markdown, blocks, code, heading, table_of
from ..phrases import ALIKE, MARGINS, UNSHOWN, difference, effect, too_few, verdict
from ..results import Results
from ..statistics import SIGNIFICANCE, PairedTest
from ..story import Blocks, Figures, Part, Report, is_many, subjects
from ..text import FILES, grouped, number, words

ORDER = 100
QUESTION = "Which method gives the better picture, and by how much?"
NAMED = 3  # methods of one letter
LISTED = 10  # methods, or targets of all of them
LISTED_EACH = 3  # targets of a method
MOST_DISPLAYS, MOST_ROWS = 2, 30  # of boards, one below the other
ASKS = re.compile(r"^(Does|Do|Is|Are)\b.*\b(better|gains?|beats?)\b")
CONTROL = "Control: the share of what a change of the hologram does to its capture that a model foresees (0 to 1)."
EFFECTS = {  # in words, of a method and of several
    "better": ("beats", "beat"),
    UNSHOWN: ("is not shown to differ from", "are not shown to differ from"),
    ALIKE: ("is as good as", "are as good as"),
    "worse": ("loses to", "lose to"),
    "not tested": ("is, untested, against", "are, untested, against"),
}
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
    """What becomes of the methods of the question; who is best, without a camera, and with one at the picture."""
    tests = [row.test for row in display.rows if row.test and row.label in subjects(results)]
    sentences = [
        *_at_speed(results, display),
        *_yes(results, tests),
        *compared(results, tests),
        *_best(results, display),
    ]
    return f"{begin}{' '.join(sentences)}" * bool(sentences)


def _at_speed(results: Results, display: Display) -> Iterator[str]:
    """Of the networks of the question that take no photograph, which are better than every method as fast."""
    blind = [row for row in display.rows if row.label in {*subjects(results)} & results.facts.labels("blind")]
    better = [row.label for row in blind if not any(mark.startswith("dominated") for mark in row.marks)]
    if blind and results.study.measure == "picture":
        yield f"Better than every method as fast: {words(better) or 'none'}."


def _yes(results: Results, tests: list[PairedTest]) -> Iterator[str]:
    """Yes or no, where a question asks whether its methods are better and all of them have one answer."""
    asked = ASKS.search(results.study.question) and not results.facts.labels("blind").intersection(subjects(results))
    told = {effect(results.headline, test) for test in tests}
    if (
        asked
        and told
        and "not tested" not in told
        and not too_few(results)
        and (told == {"better"} or "better" not in told)
    ):
        yield "Yes." if "better" in told else "No."


def compared(results: Results, tests: list[PairedTest]) -> Iterator[str]:
    """A sentence for the methods with one effect against the baseline, those with published figures apart."""
    score, known = results.headline, dict[str, str]()
    for test in tests:
        margin = published(results, test.second, test.condition)
        known[test.second] = "" if margin is None else f"; published {score.with_unit(margin, signed=True)}"
    groups = grouped(((effect(score, test), known[test.second]), test) for test in tests)
    few = bool(too_few(results))
    for told, beside in sorted(groups, key=lambda group: [*EFFECTS].index(group[0])):
        same = sorted(groups[told, beside], key=lambda test: -score.sign * test.estimate.mean)
        names, ends = (
            words([test.second for test in same]),
            [score.number(test.estimate.mean, signed=True) for test in same],
        )
        by = f"{' to '.join(dict.fromkeys((ends[0], ends[-1])))} {score.unit}".strip()
        if len(same) == 1 and told in ("better", "worse"):
            by = difference(score, same[0].estimate)
        if few:  # no test can show anything, so that counts say what is there
            each = zip(same, ends, strict=True)
            counts = (
                f"{by} {score.unit}, better on {t.better(score.sign)} of {t.estimate.n} targets" for t, by in each
            )
            yield f"{names} against {results.baseline}: {'; '.join(counts)}{beside}."
        else:
            yield f"{names} {EFFECTS[told][len(same) > 1]} {results.baseline}, {by}{beside}."


def _best(results: Results, display: Display) -> Iterator[str]:
    """Who leads among those that see no camera at the scored picture, and in the other groups."""
    complete = [
        rows for _, group in display.groups if (rows := [row for row in group if row.scored == len(results.targets)])
    ]
    groups = {(rows[0].category, rows[0].frames > 1): rows for rows in complete}
    single = [rows for (category, several), rows in groups.items() if category not in (ONLINE, ORACLE) and not several]
    first = max(single, key=lambda rows: results.headline.sign * rows[0].score.mean, default=[])
    blind = groups.get((OPEN_LOOP, False), []) if first is groups.get((CALIBRATED, False)) else []
    places = (
        (first, f"Best{_among(results, display, first)}"),
        (blind if blind and blind[0].test else [], "Without a camera"),
        (groups.get((OPEN_LOOP, True), []), "With several frames"),
        (groups.get((ONLINE, False), []), "With photographs of the picture itself"),
    )
    against = f" against {results.baseline}"
    for rows, where in places:
        if rows:
            row, tied, shared = rows[0], [row.label for row in rows if row.tier == "A"][:NAMED], "alike"
            if not tied and row.label == results.baseline:
                unshown = [each.label for each in rows if each.test and verdict(results.headline, each.test) == UNSHOWN]
                tied, shared = [row.label, *unshown][:NAMED], "not told apart"
            parts = [words(tied or [row.label]), *[shared] * (len(tied) > 1)]
            parts += [results.headline.with_unit(row.score.mean)] * (rows is first)
            if row.test and results.baseline not in tied:
                mean = results.headline.with_unit(row.test.estimate.mean, signed=True)
                is_known = rows is first and verdict(results.headline, row.test) != UNSHOWN
                parts.append(f"{difference(results.headline, row.test.estimate) if is_known else mean}{against}")
                told = verdict(results.headline, row.test)
                parts += {UNSHOWN: [UNSHOWN], "not tested": ["untested"]}.get(told, [])
                against = ""
            parts += [row.camera.replace(" ", " photographs ", 1)] if row.photographs else []
            yield f"{where}: {', '.join(parts)}."


def _among(results: Results, display: Display, rivals: list[Row]) -> str:
    """Among whom the best row leads, where the baseline has more of the camera, the display or the panel, and is
    better."""
    test = rivals[0].test if rivals else None
    if test is None or not results.headline.better(0.0, test.estimate.mean):
        return ""
    more = {ORACLE: " without knowing the display", ONLINE: " without photographs of the picture itself"}
    several = any(row.frames > 1 for row in display.rows if row.label == results.baseline)
    return more.get(results.category(test.first), " in one frame" * several)


def published(results: Results, label: str, condition: str) -> float | None:
    """The margin of two published figures beside a display, where a method and the baseline have one."""
    names, metric = (label, str(results.baseline)), results.headline.metric
    own, other = (results.facts.published(name, condition).get(metric) for name in names)
    return None if own is None or other is None else own - other


def table(board: Board) -> Markdown | None:
    """The board of each display; of more rows than a reader takes in, a row a method and a column a display."""
    drawn = [_matrix(board)] if _is_large(board) else boards(board)
    return blocks([*drawn, legend(board, lettered=not _is_large(board))]) if board.displays else None


def _is_large(board: Board) -> bool:
    return len(board.displays) > MOST_DISPLAYS or sum(len(display.rows) for display in board.displays) > MOST_ROWS


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


def legend(board: Board, lettered: bool = True) -> str:
    """What the letters or the marks of a board are, and its brackets, and what a gray picture scores. lettered: whether
    it is a board of each display, whose rows have letters."""
    results, rows = board.results, [row for each in board.displays for row in each.rows]
    floors = [(each.floor, each.name) for each in board.displays if each.floor is not None]
    known = grouped((results.headline.with_unit(floor), name) for floor, name in floors)
    gray = [f"{value} on {words(names)}" if len(known) > 1 else value for value, names in known.items()]
    least, letters = MARGINS.get(results.headline.unit, (0.0, 0.0))[0], any(row.tier for row in rows)
    alike = f" by {least:g} {results.headline.unit} or more" if least else ""
    texts = [f"Methods of a group with one letter are alike: no test tells them apart{alike}."] if letters else []
    if not lettered:
        against = f", in brackets the difference to {results.baseline}" if results.baseline else ""
        texts = [f"{results.headline.axis}{against}. *: no better than gray."]
    if any(row.test and verdict(results.headline, row.test) == UNSHOWN for row in rows):
        count = sum(not np.isnan(test.p) for test in results.tests.values())
        texts.append(f"°: {UNSHOWN} (p ≥ {SIGNIFICANCE:g}, adjusted for {count} comparisons).")
    texts += [f"A gray picture scores {'; '.join(gray)}."] * bool(gray)
    texts += [CONTROL] * bool(results.control)
    return " ".join([*texts, *["Brackets: 95 % intervals."] * lettered])


def _matrix(board: Board) -> Markdown | None:
    """A row a method, those of most displays and largest mean difference first, within their group."""
    results, score = board.results, board.results.headline
    groups = grouped((name, row) for display in board.displays for name, rows in display.groups for row in rows)
    lines, known = list[Mapping[str, object]](), {(d.name, row.label): row for d in board.displays for row in d.rows}
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
    score, total = board.results.headline, len(board.results.targets)
    if row.scored < total:
        return f"{score.number(row.score.mean)}, {row.scored} of {total} targets"
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


def figures(report: Report) -> Iterator[tuple[Path, str]]:
    """Differences to the baseline on each display that has any; of many displays on the first."""
    results = report.results
    own = results.study.measure == "error_budget" or (is_many(results) and not results.facts.predicts)
    drawn = [] if own else paired.displays(results)
    for condition, stem in drawn[:1] if is_many(results) else drawn:
        path = report.figures / f"quality-paired-{stem}.png"
        yield path, paired.draw(results, condition, path)


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
    noun = "row" if several else "method"
    have = f"1 {noun} that has every target is" if ranked == 1 else f"{ranked} {noun}s that have every target are"
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
    return not is_many(report.results) and _is_large(board(report.results))


PARTS = (Part(8, _boards, applies=_has_matrix, details=True),)
