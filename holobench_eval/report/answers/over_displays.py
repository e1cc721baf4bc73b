"""Many displays: on how many is a method better, by how much over all of them, and what decides it?"""

from __future__ import annotations

from collections.abc import Iterator

from ..data import over_displays as over
from ..data.board import Board
from ..data.results import Results
from ..data.statistics import cause
from ..data.text import words
from ..markdown import Markdown, table_of
from ..story import subjects
from .kind import Kind

MOST = 2  # methods that the answer names beside those of the question


def verdicts(results: Results) -> Iterator[str]:
    """The methods of the question; which is best, and what tells it; the best ones; what decides their margins; what
    judges their models; where no score could be had."""
    found, asked = over.margins(results), subjects(results)
    if not found:
        yield "No display has a score of every method for every target."
        return
    count = len(over.shown_on(results))
    about = [each for label in asked for each in found if each.label == label]
    for each in about:
        yield f"{_told(results, each, count)}{_published(results, each)}."
    yield from _map(results)
    if others := [each for each in found if each not in about][:MOST]:
        yield f"{'; '.join(_told(results, each, count) for each in others)}."
    yield from _judged(results)
    yield from _decides(results, about or found[:1])
    if count < len(results.conditions):
        left = [name for name in results.conditions if name not in over.shown_on(results)]
        yield f"Left out, since scores are missing: {words(left)}."


def _told(results: Results, each: over.Margin, count: int) -> str:
    score, (low, high) = results.headline, each.spread
    worse = f" and loses on {each.worse}" if each.worse else ""
    return (
        f"{each.label} beats {results.layout.baseline} on {each.better} of {count} displays{worse}: "
        f"median {score.with_unit(each.median, signed=True)}, {score.number(low, signed=True)} to "
        f"{score.number(high, signed=True)} on nine in ten"
    )


def _published(results: Results, each: over.Margin) -> str:
    """Where the published margin falls among those of the displays."""
    score, margin = results.headline, over.published(results, each.label, results.conditions[0])
    if margin is None:
        return ""
    above = int((each.values >= margin).sum())
    return f"; {above or 'none'} {'has' if above < 2 else 'have'} the published {score.with_unit(margin, signed=True)}"


def _map(results: Results) -> Iterator[str]:
    """The method that is best on most displays, and whether an error budget of a display tells where another is."""
    gained, score = over.gains(results), results.headline
    best, count = over.winners(gained), len(over.shown_on(results))
    usual = max(gained, key=best.__getitem__)
    found = over.display_map(results)
    if found:
        behind, always = score.with_unit(found.cost), score.with_unit(found.always(usual))
        if found.cost < found.always(usual):
            yield (
                f"To choose, measure an error budget: it names the best method on {found.hits} of {count} displays "
                f"left out and costs {behind} on average ({usual} always: {always})."
            )
        else:
            yield (
                f"To choose, measure nothing: always taking {usual} costs {always} on average. An error budget names "
                f"the best method on {found.hits} of {count} displays left out and costs {behind}."
            )
    yield f"{usual} is best on {best[usual]} of {count}."
    asked = [label for label in dict.fromkeys([*subjects(results), usual]) if label != results.layout.baseline]
    if found and (shares := [f"{max(found.explained(label), 0):.2f} of {label}" for label in asked]):
        yield (
            f"Its parts ({found.axes[0]}; {found.axes[1]}) predict margins on displays left out: R2 {words(shares)}."
        )


def _judged(results: Results) -> Iterator[str]:
    """How well two scores of the models rank the methods that optimise through them."""
    if parts := [f"{score} in {right} of {pairs}" for score, (right, pairs) in over.judged(results).items()]:
        yield f"Of two methods on a display, that of the better model is the better one: by {words(parts)} pairs."


def _decides(results: Results, about: list[over.Margin]) -> Iterator[str]:
    known = over.parameters(results)
    for each in about:
        if found := cause(each.values, known):
            of = f"the margin of {each.label}"
            share = f"R2 {max(found.explained, 0.0):.2f} of displays left out"
            if found.is_clear:
                yield f"What decides {of}: {found.parameter} (rank correlation {found.rho:+.2f}, {share})."
            else:
                yield f"No parameter of the displays predicts {of} (the best is {found.parameter}, {share})."


def summary(board: Board) -> Markdown | None:
    """A row for every method."""
    score, count = board.results.headline, len(over.shown_on(board.results))
    return table_of(
        [
            {
                "method": each.label,
                f"over displays and pictures{score.brackets}": score.estimate(each.over_both, signed=True),
                f"median{score.brackets}": score.number(each.median, signed=True),
                "5 to 95 % of displays": " to ".join(score.number(end, signed=True) for end in each.spread),
                f"better on [of {count}]": each.better,
                "worse on": each.worse,
            }
            for each in over.margins(board.results)
        ]
    )


KIND = Kind(
    question="On how many of the displays is a method better than the baseline, and by how much over all of them?",
    applies=over.applies,
    verdicts=verdicts,
    table=summary,
    limits=(
        "Displays: drawn from assumed ranges, so that an interval over them speaks for displays of these ranges. "
        "Better and worse are shown by one family of tests over all methods and displays.",
    ),
)
