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
from ..data.over_displays import is_many
from ..data.phrases import short, tested, value, verdict
from ..data.results import Results
from ..data.text import words
from ..markdown import Markdown, table
from .comparison import best, floor, rows
from .kind import Kind, subjects


def sentences(results: Results) -> Iterator[str]:
    """The best, the named ones against the baseline, control, the published order, and who predicts worse than no
    network; over many displays, who leads on how many."""
    if is_many(results):
        yield from _leads(results)
        return
    yield from _against(results)
    yield best(results)
    yield from controlled(results)
    yield from reported(results)
    yield from _untrained(results)
    yield from floor(results)


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


def over_many(results: Results) -> Markdown:
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


def _against(results: Results) -> Iterator[str]:
    """The networks that the question names against the baseline, by verdict."""
    condition, parts = results.conditions[0], dict[str, list[str]]()
    for label in subjects(results):
        if test := tested(results, label, condition):
            parts.setdefault(verdict(results.headline, test), []).append(f"{label} ({short(results.headline, test)})")
    if parts:
        baseline = str(results.layout.baseline)
        found = "; ".join(f"{name}: {words(labels)}" for name, labels in parts.items())
        yield f"Compared with {baseline}, which has {value(results, baseline, condition)} on {condition}: {found}."


def controlled(results: Results) -> Iterator[str]:
    """Who leads by control on each display, before the one that predicts best, else before the next."""
    parts = []
    for score, condition in itertools.product(results.control, results.conditions):
        ranking, predicting = results.ranking(condition, score.key), results.ranking(condition)[:1]
        own = {label: score.number(float(results.values(label, condition, score.key).mean())) for label in ranking}
        others = [f", before {label}, which predicts best, with {own[label]}" for label in predicting if label in own]
        if predicting == ranking[:1]:
            others = [f", before {label} with {own[label]}" for label in ranking[1:2]]
        for first in ranking[:1]:
            most = score.number(float(results.values(first, condition, MOST).mean()))
            parts.append(f"{first} leads on {condition} with {own[first]} of {most} that noise allows{''.join(others)}")
    if parts:
        yield f"By control, what a model answers of a change on the display (1: all of it), {'; '.join(parts)}."


def reported(results: Results) -> Iterator[str]:
    """The published order of the rows, and the one that was measured."""
    published = {label: row["psnr"] for label, row in results.layout.reported.items() if "psnr" in row}
    condition = results.layout.reported_beside or results.conditions[0]
    ranked = [label for label in results.ranking(condition) if label in published]
    if len(ranked) < 2 or not results.headline.key.startswith("psnr"):
        return
    order = sorted(ranked, key=lambda label: -published[label])
    first = f"{order[0]} first ({published[order[0]]:g} dB)"
    here = ranked.index(order[0]) + 1
    verdict = "the same order" if order == ranked else f"another order here, where it is number {here} of {len(ranked)}"
    yield (
        f"The paper reports {first} of the rows that it has, on other hardware and images: {verdict} "
        f"({value(results, order[0], condition)})."
    )


def _untrained(results: Results) -> Iterator[str]:
    """Trained rows that predict captures worse than the ideal image, which is a prediction without training."""
    condition, layout = results.conditions[0], results.layout
    for identity in [label for label in layout.identities if results.is_complete(label, condition)][:1]:
        own, better = results.values(identity, condition).mean(), results.headline.better
        trained = [label for label in results.ranking(condition) if label in layout.trained - layout.identities]
        below = [label for label in trained if better(own, float(results.values(label, condition).mean()))]
        if below:
            yield (
                f"{words(below)} predict{'s' * (len(below) == 1)} worse than the ideal image, what "
                f"ideal optics would make of the hologram; it takes no training and scores "
                f"{value(results, identity, condition)}."
            )


KIND = Kind(
    question="Which network predicts the captures of the display best?",
    applies=lambda results: results.layout.measure == "prediction",
    sentences=sentences,
    table=lambda results: over_many(results) if is_many(results) else rows(results),
    limits=("Training: one short training of each network; the order after longer ones may be another.",),
)
