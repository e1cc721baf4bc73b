"""Comparison of methods: what is best on each display, and is what the question names better than the baseline?"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ...core.errors import listed
from ...study.folders.files import remedies
from ..board import Display, Row, board
from ..data.over_displays import published
from ..facts import CALIBRATED, ONLINE, OPEN_LOOP, ORACLE
from ..phrases import difference, verdict
from ..results import Results
from ..text import FILES, number, words
from .kind import Kind, subjects

NAMED = 3  # methods of one letter
LISTED = 10  # methods, or targets of all of them
LISTED_EACH = 3  # targets of a method

Lacks = dict[tuple[str, str], list[str]]  # the targets that a method lacks on a display
OTHER = "{baseline}"  # the place of the baseline's name, which a verdict says once


def verdicts(results: Results) -> Iterator[str]:
    """One a display, then which methods lack targets."""
    drawn = board(results).displays
    for display in drawn:
        yield of_display(results, display, f"{display.name}: " if len(drawn) > 1 else "")
    yield lacking(results)


def of_display(results: Results, display: Display, begin: str = "") -> str:
    """Who leads without a camera at the scored picture, with one, and what becomes of the methods of the question."""
    complete = [(group, [row for row in rows if row.scored == len(results.targets)]) for group, rows in display.groups]
    groups = {group: rows for group, rows in complete if rows}
    rivals = [rows for group, rows in groups.items() if group not in (ONLINE, ORACLE)]
    sign = results.headline.sign
    first = max(rivals, key=lambda rows: sign * rows[0].score.mean, default=[])
    told, parts = list[str](), list[str]()
    for rows, where in (
        (first, _among(results, first)),
        (groups.get(OPEN_LOOP, []) if first and first is groups.get(CALIBRATED) else [], "without a camera "),
        (groups.get(ONLINE, []), "with photographs of the picture itself "),
    ):
        if rows:
            tied = [row.label for row in rows if row.tier == "A"][:NAMED] or [rows[0].label]
            told += tied
            parts.append(f"{where}{_leads(results, rows[0], tied)}")
    for row in display.rows:
        if row.test and row.label in subjects(results) and row.label not in told:
            margin = published(results, row.label, display.name)
            said = "" if margin is None else f" (published {results.headline.with_unit(margin, signed=True)})"
            parts.append(f"{row.label} {against(results, row)}{said}")
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
    mean = results.headline.with_unit(row.score.mean)
    apart = f" ({mean})" if len(tied) == 1 else f", not told apart ({mean})"
    cost = f", for {number(row.photographs)} photographs" if row.photographs else ""
    gained = f", {against(results, row)}" if row.test else ""
    return f"{words(tied)} lead{'s' * (len(tied) == 1)}{apart}{gained}{cost}"


def against(results: Results, row: Row) -> str:
    """``+1.30 dB [+0.43, +2.17]``, what it is the difference to, and whether that is shown."""
    assert row.test is not None
    shown = {"not shown to differ": ", not shown", "not tested": ", untested"}
    text = difference(results.headline, row.test.estimate)
    return f"{text}{OTHER}{shown.get(verdict(results.headline, row.test), '')}"


KIND = Kind(
    question="Which method gives the better picture, and by how much?", applies=lambda results: True, verdicts=verdicts
)

# Paper Table 2: how well does a method exploit the network that stands for the display?
ON_A_NETWORK = Kind(
    question="How good are the pictures that the learned display predicts?",
    applies=lambda results: results.facts.network and results.study.measure == "picture",
    verdicts=verdicts,
)


def lacking(results: Results) -> str:
    """Who lacks which targets, and what to do about it; empty where every method has a score for every target."""
    pairs = [(label, condition) for condition in results.conditions for label in results.methods(condition)]
    missing = {pair: np.array(results.targets)[np.isnan(results.values(*pair))].tolist() for pair in pairs}
    lacks = {pair: names for pair, names in missing.items() if names}
    if not lacks:
        return ""
    ranked, several = len(pairs) - len(lacks), len(results.conditions) > 1
    who = [
        f"{label}{f' on {condition}' * several} lacks {_of(names, len(results.targets))}"
        for (label, condition), names in lacks.items()
    ]
    if ranked:
        have = "1 method that has every target is" if ranked == 1 else f"{ranked} methods that have every target are"
        said = f"Only the {have} ranked"
    else:
        said = "No method is ranked, since none has every target"
    common = _in_common(results, lacks) if results.study.measure == FILES else ""
    return f"{said}: {_first(who, LISTED)}. {_remedy(results, lacks)}{common}"


def _in_common(results: Results, lacks: Lacks) -> str:
    """How given photographs of two methods differ on the targets that both have, where one of them lacks some."""
    display, total = results.conditions[0], len(results.targets)
    labels = sorted(results.methods(display), key=lambda label: (label, display) in lacks)
    first = results.baseline or labels[0]
    told = []
    for label in labels:
        if label != first and {(label, display), (first, display)} & lacks.keys():
            found = results.estimate(results.values(label, display) - results.values(first, display))
            told += [f"{label} {difference(results.headline, found)} on {found.n} of {total}"] if found.n else []
    return f" Against {first}, on the targets that both have: {_first(told, LISTED)}." if told else ""


def _of(missing: list[str], total: int) -> str:
    if len(missing) == total:
        return f"all {total} targets" if total > 1 else "the target"
    return f"{len(missing)} of {total} targets ({_first(missing, LISTED_EACH)})"


def _remedy(results: Results, lacks: Lacks) -> str:
    """How all of them are ranked, or without some targets all that have any score."""
    some = [names for names in lacks.values() if len(names) < len(results.targets)]
    away = [name for name in results.targets if any(name in names for names in some)]
    left, who = len(results.targets) - len(away), "all" if len(some) == len(lacks) else "all that have any score"
    if results.study.measure == FILES:
        holes = results.holes[["state", "label", "target", "reason"]].itertuples(index=False, name=None)
        way = remedies((str(state), str(method), str(target), str(reason)) for state, method, target, reason in holes)
        moved = f"move the targets and captures of {_first(away, LISTED)} away"
        fewer = f"{moved} and rank {who} by the {left} target{'s' * (left > 1)} left"
    else:
        way = "Mend what the reasons in details.md say and run the same command again."
        fewer = f"name the other {left} targets with --targets to rank {who} by these"
    return f"{way[:-1]}, or {fewer}." if away and left else way


def _first(names: list[str], most: int) -> str:
    more = len(names) - most
    return f"{listed(names[:most])}{f' and {more} more' if more > 0 else ''}"
