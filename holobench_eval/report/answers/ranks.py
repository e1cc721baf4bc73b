"""Rank stability: does the order of the methods survive another bench of the same kind?"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ...display.simulated.changes.draws import PARAMETERS
from ..data.ranks import Cause, Pair, Ranks, ranks
from ..data.results import Results
from ..data.text import percent, words
from ..markdown import Markdown
from ..markdown import table as markdown_table
from .kind import Kind

CLOSEST = 3  # pairs that turn round most often, which the answer names


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
    turning = sorted((pair for pair in each.pairs if pair.flips), key=lambda pair: -pair.flips)
    still = len(each.pairs) - len(turning)
    named = [
        f"{pair.first} over {pair.second} ({percent(pair.flipped)} % of draws, nominally "
        f"{each.results.headline.with_unit(pair.nominal, signed=True)}"
        f"{', in which that display is not typical of its draws' * (2 * pair.flips > len(each.used))})"
        for pair in turning[:CLOSEST]
    ]
    most = f"; most often reversed: {'; '.join(named)}" if named else ""
    return f"{still} of {len(each.pairs)} pairs of methods keep their order in every draw{most}."


def _cause(each: Ranks) -> Iterator[str]:
    caused = sorted((pair for pair in each.pairs if pair.cause), key=lambda pair: -pair.flips)
    if caused:
        parts = [_goes_with(pair, pair.cause) for pair in caused[:CLOSEST] if pair.cause]
        yield f"What turns the order, by rank correlation over draws, adjusted for all tried: {'; '.join(parts)}."
    elif any(pair.flips for pair in each.pairs):
        yield "No single parameter of the draws is shown to turn the order of any pair."


def _goes_with(pair: Pair, cause: Cause) -> str:
    gains = pair.first if cause.correlation > 0 else pair.second
    form = "" if cause.feature.form == "value" else f" ({cause.feature.form})"
    words = PARAMETERS[cause.feature.parameter].words
    return f"more {words}{form} favours {gains} of {pair.first} and {pair.second} (rho {abs(cause.correlation):.2f})"


def _other_displays(each: Ranks) -> Iterator[str]:
    """Whether displays of the study beside the one that is drawn have the same order."""
    results, before = each.results, each.swept.before
    orders = {name: [x for x in results.ranking(name) if x in each.methods] for name in results.conditions}
    others = {name: order for name, order in orders.items() if name != before and len(order) == len(each.methods)}
    same = [name for name, order in others.items() if order == orders[before]]
    if others:
        differ = [name for name in others if name not in same]
        parts = [f"the same on {words(same)}"] if same else []
        parts += [f"another on {words(differ)}"] if differ else []
        yield f"The order of the means is {' and '.join(parts)}."


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
        "Draws: the bench varies within assumed ranges, target images and holograms stay, and intervals of shares and "
        "of tau are over draws; they do not say what other images or other ranges would give.",
    ),
)
