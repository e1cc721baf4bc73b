"""Rank stability: does the order of the methods survive another bench of the same kind?"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence

import numpy as np

from ...display.simulated.changes.draws import PARAMETERS
from ..data.ranks import Cause, Pair, Ranks, ranks
from ..data.results import Results
from ..data.text import percent, words
from ..markdown import Markdown
from ..markdown import table as markdown_table
from .kind import Kind

CLOSEST = 3  # groups of pairs that turn round most often, which the answer names


def sentences(results: Results) -> Iterator[str]:
    """Agreement of the rankings, who is first, which pairs turn round, and with what."""
    found = [each for each in ranks(results) if each.exists]
    if not found:
        yield "No draw has two methods with a score for every target, so there is no ranking to compare."
    for each in found:
        yield _agreement(each)
        yield _first(each)
        yield _turning(each)
        yield from _cause(each)
        yield from _other_displays(each)


def _agreement(each: Ranks) -> str:
    count = len(each.used)
    kept = f"all {len(each.methods)} methods keep their nominal rank in {each.unchanged} of {count} draws"
    if not len(each.taus):
        return f"All methods score the same on the draws of {each.swept.before}, so that no correlation is defined."
    tau = each.tau
    interval = f" [{tau.low:.2f}, {tau.high:.2f}]" if np.isfinite(tau.low) else ""
    return (
        f"Kendall's tau between the ranking on a random draw of {each.swept.before} and that on {each.swept.before} "
        f"itself (1: the same order, 0: unrelated) is {tau.mean:.2f}{interval} on average and {each.taus.min():.2f} at "
        f"the lowest; {kept}."
    )


def _first(each: Ranks) -> str:
    nominal = [label for label, rank in zip(each.methods, each.nominal_positions, strict=True) if rank == 1]
    stays = [f"{label} ranks first on {each.swept.before} and in {percent(each.first(label))} %" for label in nominal]
    others = sorted((label for label in each.methods if label not in nominal), key=lambda x: -each.first(x).mean)
    also = [f"{label} in {percent(each.first(label))} %" for label in others if each.first(label).mean > 0]
    return f"{words(stays)} of its draws{'; first in others: ' + '; '.join(also) if also else '; no other method is'}."


def _turning(each: Ranks) -> str:
    turning = sorted((pair for pair in each.pairs if pair.flips), key=lambda pair: (-pair.flips, pair.first))
    still = len(each.pairs) - len(turning)
    apart = [pair for pair in turning if _is_apart(each, pair)]
    groups = [list(group) for _, group in itertools.groupby(apart, lambda pair: (pair.flips, pair.first))]
    named = [
        f"on {each.swept.before} {group[0].first} is above {words([pair.second for pair in group])} by "
        f"{_nominal(each, group)}, and below {'each ' * (len(group) > 1)}in {percent(group[0].flipped)} % of draws"
        f"{', so that this display is the exception' * (2 * group[0].flips > len(each.used))}"
        for group in groups[:CLOSEST]
    ]
    most = f"; most often reversed: {'; '.join(named)}" if named else ""
    return f"{still} of {len(each.pairs)} pairs of methods keep their order in every draw{most}."


def _is_apart(each: Ranks, pair: Pair) -> bool:
    """Whether two methods differ at all on the display itself, to the digits of the score."""
    number = each.results.headline.number
    return number(abs(pair.nominal)) != number(0.0)


def _nominal(each: Ranks, group: Sequence[Pair]) -> str:
    """The lead of the first of each pair before any draw, or its range."""
    ends = [extreme(pair.nominal for pair in group) for extreme in (min, max)]
    return " to ".join(dict.fromkeys(each.results.headline.with_unit(end) for end in ends))


def _cause(each: Ranks) -> Iterator[str]:
    groups: dict[str, list[tuple[str, Cause]]] = {}
    for pair in sorted((pair for pair in each.pairs if _is_apart(each, pair)), key=lambda pair: -pair.flips):
        if cause := pair.cause:
            gains, loses = (pair.first, pair.second) if cause.correlation > 0 else (pair.second, pair.first)
            form = "" if cause.form == "value" else f" ({cause.form})"
            favours = f"more {PARAMETERS[cause.parameter].words}{form} favours {gains}"
            groups.setdefault(favours, []).append((loses, cause))
    if groups:
        parts = [
            f"{favours} over {words([loses for loses, _ in group])} ({_strengths([cause for _, cause in group])})"
            for favours, group in list(groups.items())[:CLOSEST]
        ]
        yield f"What turns the order, by rank correlation over draws, adjusted for all tried: {'; '.join(parts)}."
    elif any(pair.flips for pair in each.pairs):
        yield "No single parameter of the draws is shown to turn the order of any pair."


def _strengths(causes: Sequence[Cause]) -> str:
    sizes = [abs(cause.correlation) for cause in causes]
    return f"rho {' to '.join(dict.fromkeys(f'{extreme(sizes):.2f}' for extreme in (min, max)))}"


def _other_displays(each: Ranks) -> Iterator[str]:
    """Whether displays of the study beside the one that is drawn have the same order."""
    results, before = each.results, each.swept.before
    orders = {name: [x for x in results.ranking(name) if x in each.methods] for name in results.conditions}
    others = {name: order for name, order in orders.items() if name != before and len(order) == len(each.methods)}
    same = [name for name, order in others.items() if order == orders[before]]
    if others:
        differ = [name for name in others if name not in same]
        parts = [f"on {words(same)} as on {before}"] if same else []
        parts += [f"on {words(differ)} another than on {before}"] if differ else []
        yield f"The methods' order by their mean score is {' and '.join(parts)}."


def table(each: Ranks) -> Markdown:
    """Where each method stands, nominally and over the draws."""
    columns = ["method", "nominal rank", "first in [% of draws]", "mean rank", "best rank", "worst rank"]
    rows = []
    for index, label in enumerate(each.methods):
        column = each.positions[:, index]
        first = percent(each.first(label))
        ends = (f"{column.min():.0f}", f"{column.max():.0f}")
        rows.append([label, f"{each.nominal_positions[index]:.0f}", first, f"{column.mean():.1f}", *ends])
    return markdown_table(columns, rows)


KIND = Kind(
    question="Does the ranking of the methods survive another bench of the same kind?",
    applies=lambda results: bool(ranks(results)),
    sentences=sentences,
    table=lambda results: next((table(each) for each in ranks(results) if each.exists), None),
    limits=(
        "Draws: the bench varies within assumed ranges, target images and holograms stay, and brackets of shares and "
        "of tau are over draws and not over images; they do not say what other images or other ranges would give.",
    ),
)
