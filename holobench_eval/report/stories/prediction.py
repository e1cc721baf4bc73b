"""Prediction (paper Table 1): which network predicts the captures of a display best, and is any better than none?

Where the study measures control, also which one answers a change of the hologram as the display does: that is what a
method needs that optimises through a network.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

import numpy as np

from ...metrics.control import MOST
from .. import markdown
from ..board import Board, Display, board
from ..markdown import Markdown
from ..phrases import effect, too_few, value
from ..results import Results
from ..scores import Score
from ..statistics import FEWEST, SIGNIFICANCE, family_p
from ..story import is_many, subjects
from ..text import grouped, words
from .comparison import EFFECTS, NAMED
from .comparison import table as board_table

ORDER = 30
QUESTION = "Which network predicts the captures of the display best?"
LIMITS = ("Training: one short training of each network; the order after longer ones may be another.",)


def applies(results: Results) -> bool:
    """Whether predictions are scored."""
    return results.study.measure == "prediction"


def verdicts(results: Results) -> Iterator[str]:
    """One a display; over many displays, who leads on how many by prediction and by control, and its mean over them."""
    count, scores = len(results.conditions), [results.headline, *results.control]
    for score in scores if is_many(results) else ():
        firsts = Counter(ranking[0] for name in results.conditions if (ranking := results.ranking(name, score.key)))
        most, means = max(firsts.values(), default=0), list[str]()
        tied = [label for label, leads in firsts.items() if leads == most]
        for label in tied:
            known = _means(results, label, score)
            means.append(f"{label} ({score.with_unit(float(np.mean(known)))} in the mean over {len(known)})")
        leads = f"lead{'s' * (len(tied) == 1)} on {most} of {count} displays{' each' * (len(tied) > 1)}"
        yield f"By {score.title}, {words(means)} {leads}." * bool(tied)
    for display in () if is_many(results) else board(results).displays:
        if ranking := results.ranking(display.name):
            best = leader(results, display, ranking)
            sentences = [*_reported(results, display.name), *_named(results, display.name), best]
            sentences += _controls(results, display.name)
            yield f"{f'{display.name}: ' * (count > 1)}{' '.join(sentences)}"


def is_untestable(results: Results) -> bool:
    """Whether the clusters are too few for a test to show anything, so that its silence says nothing."""
    return len(set(results.clusters)) < FEWEST or bool(too_few(results))


def leader(results: Results, display: Display, ranked: list[str], cost: str = "") -> str:
    """A sentence of the first of some methods, and of those that are not told apart from it: by the letters of their
    group, and in other groups by the interval of the difference. cost: what the first one took, in words."""
    first, *others = ranked
    places = {row.label: (rows[0].label, row.tier) for _, rows in display.groups for row in rows}
    own = results.values(first, display.name)

    def is_alike(label: str) -> bool:
        if places[label][0] == places[first][0]:
            return places[label] == places[first]
        return not results.estimate(own - results.values(label, display.name)).is_clear

    alike, mean = [label for label in others if is_alike(label)], value(results, first, display.name)
    if others and is_untestable(results):
        return f"Highest, untested: {first}{cost}, {mean}."
    more = [f"{len(alike) - NAMED} more"] * (len(alike) > NAMED)
    if alike:
        return f"Highest: {first}{cost}, {mean}, not told apart from {words([*alike[:NAMED], *more])}."
    return f"Best: {first}{cost}, {mean}."


def _controls(results: Results, condition: str) -> Iterator[str]:
    """Who leads by control."""
    for score in results.control:
        for first in results.ranking(condition, score.key)[:1]:
            own, most = (results.values(first, condition, key).mean() for key in (score.key, MOST))
            best = results.ranking(condition)[0]
            who = "It answers changed holograms best" if first == best else f"Changed holograms {first} answers best"
            yield f"{who}: control {score.number(own)} of {score.number(most)}."


def _named(results: Results, condition: str) -> Iterator[str]:
    """Which networks of the question beat the baseline."""
    tests = [test for label in subjects(results) if (test := results.tested(label, condition))]
    groups = grouped((effect(results.headline, test), test.second) for test in tests)
    than = f" than {results.baseline}"
    for told, words_of in ((name, name.capitalize()) for name in (*EFFECTS,) if name in groups):
        yield f"{words_of}{than * (told in ('better', 'worse'))}: {words(groups[told])}."
        than = ""


def _reported(results: Results, condition: str) -> Iterator[str]:
    """The place of the row that was published as the first: a yes or no where tests of it against each of the others
    that were published show one."""
    published = {
        label: row["psnr"]
        for label, row in (results.study.reported.rows if results.study.reported else {}).items()
        if "psnr" in row
    }
    ranked = [label for label in results.ranking(condition) if label in published]
    if len(ranked) > 1 and condition == (results.facts.beside or condition):
        first = max(ranked, key=published.__getitem__)
        others = [label for label in ranked if label != first]
        own = results.values(first, condition)
        gains = np.array([results.headline.sign * (own - results.values(label, condition)) for label in others])
        means, is_shown = gains.mean(1), family_p(gains, results.clusters) < SIGNIFICANCE
        is_lower, is_first = (is_shown & (means < 0)).any(), (is_shown & (means > 0)).all()
        told = "No. " if is_lower else "Yes. " if is_first else ""
        ending = ", untested" if is_untestable(results) else "" if told else ", which no test shows"
        yield f"{told}{first}, published as best of {len(ranked)}, is number {ranked.index(first) + 1} here{ending}."


def table(board: Board) -> Markdown | None:
    """The board; over many displays a row a method, every score's mean over them and its range."""
    results = board.results
    if not is_many(results):
        return board_table(board)
    headers, lines = ["method"], {label: [label] for label in results.labels}
    for score in [results.headline, *results.control]:
        headers += [score.heading, "least to most of displays"]
        for label, cells in lines.items():
            known = _means(results, label, score)
            ends = f"{score.number(min(known))} to {score.number(max(known))}" if known else "–"
            cells += [score.number(float(np.mean(known))) if known else "–", ends]
    return markdown.table(headers, list(lines.values()))


def _means(results: Results, label: str, score: Score) -> list[float]:
    """Of a method's score, on the displays on which it is complete."""
    means = [float(results.values(label, name, score.key).mean()) for name in results.conditions]
    return [mean for mean in means if np.isfinite(mean)]
