"""Prediction (paper Table 1): which network predicts the captures of a display best, and is any better than none?

Where the study measures control, also which one answers a change of the hologram as the display does: that is what a
method needs that optimises through a network.
"""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Iterator

import numpy as np

from ...metrics.control import MOST
from ..data.board import Board
from ..data.phrases import tested, value, verdict
from ..data.results import Results
from ..data.text import grouped, words
from ..markdown import Markdown, table
from ..stories.comparison import table as board_table
from ..story import is_many, subjects
from .kind import Kind


def verdicts(results: Results) -> Iterator[str]:
    """One a display; over many displays, who leads on how many."""
    if is_many(results):
        yield from _leads(results)
        return
    many = len(results.conditions) > 1
    for condition in results.conditions:
        if ranking := results.ranking(condition):
            parts = [f"{ranking[0]} predicts best ({value(results, ranking[0], condition)})"]
            parts += [*_controls(results, condition), *_named(results, condition), *_reported(results, condition)]
            yield f"{f'{condition}: ' * many}{'; '.join(parts)}."


def _controls(results: Results, condition: str) -> Iterator[str]:
    """Who leads by control."""
    for score in results.control:
        for first in results.ranking(condition, score.key)[:1]:
            own, most = (results.values(first, condition, key).mean() for key in (score.key, MOST))
            yield f"{first} answers changes best (control {score.number(own)} of {score.number(most)})"


def _named(results: Results, condition: str) -> Iterator[str]:
    """Which networks of the question beat the baseline."""
    tests = [test for label in subjects(results) if (test := tested(results, label, condition))]
    groups = grouped((verdict(results.headline, test), test.second) for test in tests)
    parts = [f"{name}: {words(labels)}" for name, labels in groups.items()]
    if parts:
        yield f"than {results.layout.baseline}, {', '.join(parts)}"


def _reported(results: Results, condition: str) -> Iterator[str]:
    """The place of the row that was published as the first."""
    published = {label: row["psnr"] for label, row in results.layout.reported.items() if "psnr" in row}
    ranked = [label for label in results.ranking(condition) if label in published]
    if len(ranked) > 1 and condition == (results.layout.reported_beside or condition):
        first = max(ranked, key=lambda label: published[label])
        yield f"{first}, published as first of {len(ranked)}, is number {ranked.index(first) + 1}"


def _leads(results: Results) -> Iterator[str]:
    """Who is first on how many displays, by prediction and by control, and its mean over them."""
    for score in (results.headline, *results.control):
        firsts = [ranking[0] for name in results.conditions if (ranking := results.ranking(name, score.key))]
        for first, count in Counter(firsts).most_common(1):
            where = [name for name in results.conditions if results.is_complete(first, name, score.key)]
            mean = float(np.mean([results.values(first, name, score.key).mean() for name in where]))
            yield (
                f"By {score.title} {first} leads on {count} of {len(results.conditions)} displays; its mean over "
                f"{len(where)} is {score.with_unit(mean)}."
            )


def _over_many(results: Results) -> Markdown:
    """A row a method: every score's mean over the displays, and its range over them."""
    scores = [results.headline, *results.control]
    lines = []
    for label in results.layout.methods:
        cells = [label]
        for score in scores:
            means = [results.values(label, name, score.key).mean() for name in results.conditions]
            known = [mean for mean in means if np.isfinite(mean)]
            ends = f"{score.number(min(known))} to {score.number(max(known))}" if known else "–"
            cells += [score.number(float(np.mean(known))) if known else "–", ends]
        lines.append(cells)
    columns = [[score.heading, "least to most of displays"] for score in scores]
    return table(["method", *itertools.chain(*columns)], lines)


def rows(board: Board) -> Markdown | None:
    """The board, or means over many displays."""
    return _over_many(board.results) if is_many(board.results) else board_table(board)


KIND = Kind(
    question="Which network predicts the captures of the display best?",
    applies=lambda results: results.layout.measure == "prediction",
    verdicts=verdicts,
    table=rows,
    limits=("Training: one short training of each network; the order after longer ones may be another.",),
)
