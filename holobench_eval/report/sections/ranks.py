"""Whether the ranking survives other benches, in tables and sentences."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from markupsafe import Markup

from ...display.simulated.changes.draws import MODEL, PARAMETERS
from ..data.ranks import CIRCULAR, Cause, Feature, Pair, Ranks, share
from ..data.statistics import Estimate
from ..data.text import words
from ..markdown import escape, table
from .findings import SIGNIFICANCE, p_value

COUNTED = frozenset({"crosstalk", "flicker", "fringes", "astigmatism", "coma", "zero_order", "specks"})
"""Parameters of which there is more, and not a larger one."""
NOTHING = "none of the parameters"


def heading(ranks: Ranks) -> str:
    """Which display, and how many draws of it."""
    return f"{ranks.swept.before}, {len(ranks.swept.points)} draws"


def introduction() -> Markup:
    """How draws are made, and what the numbers mean."""
    return escape(
        f"A draw is another bench of the same kind: {MODEL}. Methods know the nominal optics alone, or were trained on "
        "the nominal display, and the same holograms are shown on every draw. Methods are ranked by their mean over "
        "targets. Brackets hold 95 % intervals over draws: other benches, the same images. Shares: Wilson's interval."
    )


def methods(ranks: Ranks) -> Markup:
    """Where each method stands, nominally and over the draws."""
    columns = ["method", "nominal rank", "first in [% of draws]", "mean rank", "best rank", "worst rank"]
    rows = []
    for index, label in enumerate(ranks.methods):
        places = ranks.places[:, index]
        first = percent(ranks.first(label))
        ends = (f"{places.min():.0f}", f"{places.max():.0f}")
        rows.append([label, f"{ranks.nominal_places[index]:.0f}", first, f"{places.mean():.1f}", *ends])
    return table(columns, rows)


def flips(ranks: Ranks) -> Markup:
    """The pairs whose order is the other way in some draw, most often first; empty where there is none."""
    flipping = sorted((pair for pair in ranks.pairs if pair.flips), key=lambda pair: -pair.flips)
    if not flipping:
        return Markup("")
    score = ranks.results.headline
    unit = f" [{score.unit}]" if score.unit else ""
    columns = ["nominally better", "than", f"nominally by{unit}", f"over draws by{unit}"]
    columns += ["other way in [% of draws]", "goes with"]
    return table(columns, [_flip(ranks, pair) for pair in flipping])


def _flip(ranks: Ranks, pair: Pair) -> list[str]:
    score, lead = ranks.results.headline, pair.lead
    return [
        pair.first,
        pair.second,
        score.number(pair.nominal, signed=True),
        score.interval(lead.mean, lead.low, lead.high, signed=True),
        percent(pair.flipped),
        favours(pair, pair.cause) if pair.cause else NOTHING,
    ]


def percent(estimate: Estimate) -> str:
    """A share in percent with its interval."""
    mean, low, high = (f"{100 * value:.0f}" for value in (estimate.mean, estimate.low, estimate.high))
    return f"{mean} [{low}, {high}]"


def favours(pair: Pair, cause: Cause) -> str:
    """``more crosstalk favours sgd (rho 0.81, p < 0.001)``."""
    gains = pair.first if cause.correlation > 0 else pair.second
    return f"{more(cause.feature)} favours {gains} (rho {abs(cause.correlation):.2f}, {p_value(cause.p)})"


def more(feature: Feature) -> str:
    """More of a parameter, in words."""
    parameter, counted = PARAMETERS[feature.parameter], feature.parameter in COUNTED
    if feature.form in ("sine", "cosine"):
        return f"a larger {feature.form} of the {parameter.words}"
    if feature.form == "size":
        return f"{'more' if counted else 'a larger'} {parameter.words} of either sign"
    signed = " positive" if parameter.low < 0 else ""
    return f"{'more' if counted else 'a more' if signed else 'a larger'}{signed} {parameter.words}"


def sentences(ranks: Ranks) -> list[str]:
    """What the draws say, from their numbers alone."""
    if not ranks.told:
        return [*left_out(ranks), "No ranking: no draw has two methods with a score for every target."]
    return [*left_out(ranks), *_agreement(ranks), _winner(ranks), *_pairs(ranks)]


def left_out(ranks: Ranks) -> list[str]:
    """Methods and draws that are in no number, and why."""
    told = []
    unranked = [label for label in ranks.quality if label not in ranks.methods]
    if unranked:
        told.append(
            "Not ranked, since they lack targets on the nominal display or in more than half of the draws: "
            f"{words(unranked)}."
        )
    empty = set(ranks.empty)
    partly = [index for index in range(len(ranks.swept.points)) if index not in empty and index not in ranks.used]
    if empty and ranks.used:
        told.append(
            f"{_draws(ranks, sorted(empty))}: no ranked method has a score for every target there, as where the camera "
            "cannot be registered (see Holes). What follows holds for benches on which it can."
        )
    if partly and ranks.used:
        told.append(f"{_draws(ranks, partly)}: a ranked method lacks a target there.")
    return told


def _draws(ranks: Ranks, indices: Sequence[int]) -> str:
    numbers = [str(ranks.swept.points[index][0]) for index in indices]
    which = f"Draws {words(numbers)} are" if len(numbers) > 1 else f"Draw {numbers[0]} is"
    return f"{which} left out ({len(numbers)} of {len(ranks.swept.points)})"


def _agreement(ranks: Ranks) -> list[str]:
    taus, count = ranks.taus, len(ranks.used)
    what = "Kendall's tau-b of a draw's ranking against the nominal one (1: the same order, 0: unrelated)"
    if not len(taus):
        return [f"{what} is not defined: all methods score the same."]
    mean = ranks.tau
    interval = f" [{mean.low:.2f}, {mean.high:.2f}]" if np.isfinite(mean.low) else ""
    return [
        f"{what}: median {np.median(taus):.2f}, mean {mean.mean:.2f}{interval}, lowest {taus.min():.2f}, over "
        f"{len(taus)} draws. The {len(ranks.methods)} methods have their nominal order in {ranks.unchanged} of "
        f"{count}."
    ]


def _winner(ranks: Ranks) -> str:
    counts = {label: int((ranks.places[:, index] == 1).sum()) for index, label in enumerate(ranks.methods)}
    winners = [label for label, place in zip(ranks.methods, ranks.nominal_places, strict=True) if place == 1]
    told = [f"{label} in {counts[label]} of {len(ranks.used)} ({percent(ranks.first(label))} %)" for label in winners]
    sentence = f"First on the nominal display, and over the draws: {words(told)}"
    others = sorted((label for label in counts if label not in winners and counts[label]), key=lambda x: -counts[x])
    if not others:
        return f"{sentence}. No other method is ever first."
    return f"{sentence}. Others that are first: {words([f'{label} in {counts[label]}' for label in others])}."


def _pairs(ranks: Ranks) -> list[str]:
    flipping = [pair for pair in ranks.pairs if pair.flips]
    still, every = len(ranks.pairs) - len(flipping), len(ranks.pairs)
    most = 100 * share(0, len(ranks.used)).high
    told = [
        f"{still} of {every} pairs of methods have their nominal order in every draw; such a pair may still be the "
        f"other way on up to {most:.0f} % of benches (upper end of the interval)."
        if still
        else f"None of the {every} pairs of methods has its nominal order in every draw."
    ]
    if flipping and ranks.tests:
        known = sum(pair.cause is not None for pair in flipping)
        told.append(
            f"Of the {len(flipping)} pairs that are the other way in some draw, {known} go with a parameter: "
            "Spearman's correlation over draws between its value and the difference of the two means, "
            f"p < {SIGNIFICANCE} after Holm over all {ranks.tests} that were tried; the strongest is named. The others "
            f"go with {NOTHING} as clearly: with several at once, with the random patterns, or with chance."
        )
    return told


def ranges(ranks: Ranks) -> Markup:
    """What was drawn of the draws that are ranked, within which range, and where that comes from."""
    ranked = [ranks.swept.drawn[index] for index in ranks.used] if ranks.swept.drawn else []
    drawn = {name: [one[name] for one in ranked] for name in (ranked or [{}])[0]}
    rows = []
    for name, values in drawn.items():
        one = PARAMETERS[name]
        shown = [f"{low:.3g} to {high:.3g}" for low, high in ((one.low, one.high), (min(values), max(values)))]
        turn = "; a full turn" if name in CIRCULAR else ""
        rows.append([one.words, one.unit or "–", *shown, f"{one.source}{turn}"])
    return table(["parameter", "unit", "range", "drawn", "source of the range"], rows) if rows else Markup("")
