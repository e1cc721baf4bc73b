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
from ..board import Board
from ..markdown import Markdown
from ..phrases import effect, value
from ..results import Results
from ..scores import Score
from ..story import is_many, subjects
from ..text import grouped, words
from .comparison import EFFECTS
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
        firsts = [ranking[0] for name in results.conditions if (ranking := results.ranking(name, score.key))]
        for first, leads in Counter(firsts).most_common(1):
            known = _means(results, first, score)
            mean, where = score.with_unit(float(np.mean(known))), f"{leads} of {count} displays"
            yield f"By {score.title}, {first} leads on {where}, with {mean} in the mean over {len(known)}."
    for condition in () if is_many(results) else results.conditions:
        if ranking := results.ranking(condition):
            best = f"Best: {ranking[0]}, {value(results, ranking[0], condition)}."
            sentences = [*_reported(results, condition), *_named(results, condition), best]
            sentences += _controls(results, condition)
            yield f"{f'{condition}: ' * (count > 1)}{' '.join(sentences)}"


def _controls(results: Results, condition: str) -> Iterator[str]:
    """Who leads by control."""
    for score in results.control:
        for first in results.ranking(condition, score.key)[:1]:
            own, most = (results.values(first, condition, key).mean() for key in (score.key, MOST))
            best = results.ranking(condition)[0]
            who = (
                "It also answers a changed hologram best"
                if first == best
                else f"To a changed hologram, {first} answers best"
            )
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
    """The place of the row that was published as the first."""
    published = {
        label: row["psnr"]
        for label, row in (results.study.reported.rows if results.study.reported else {}).items()
        if "psnr" in row
    }
    ranked = [label for label in results.ranking(condition) if label in published]
    if len(ranked) > 1 and condition == (results.facts.beside or condition):
        first = max(ranked, key=published.__getitem__)
        place, total = ranked.index(first) + 1, len(ranked)
        yield f"{'No' if place > 1 else 'Yes'}. {first}, published as best of {total}, is number {place} here."


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
