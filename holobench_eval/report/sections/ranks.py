"""Whether the ranking survives other benches, in tables and sentences."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from ...display.simulated.changes.draws import MODEL, PARAMETERS
from ..answers.ranks import table as methods
from ..charts.ranks import draw_ranks
from ..charts.style import slugs
from ..data.ranks import CIRCULAR, Cause, Pair, Ranks, share
from ..data.statistics import SIGNIFICANCE, mean_interval
from ..data.text import p_value, percent, words
from ..markdown import Markdown, bullets, heading, table
from ..section import Blocks, Figures, Report, Section

# Parameters of which there is more, and not a larger one.
COUNTED = frozenset({"crosstalk", "flicker", "fringes", "astigmatism", "coma", "zero_order", "specks"})
NOTHING = "none of the parameters"


def _render(report: Report, figures: Figures) -> Blocks:
    yield heading("Rank stability")
    yield (
        f"A draw is another bench of the same kind: {MODEL}. Methods know the nominal optics alone, or were trained on "
        "the nominal display; the same holograms are shown on every draw. Ranks order the means over targets. Brackets "
        "hold 95 % intervals over draws (other benches, the same images); those of shares are Wilson's."
    )
    for ranks in report.ranks:
        yield heading(f"{ranks.swept.before}, {len(ranks.swept.points)} draws", 3)
        yield bullets(sentences(ranks))
        if ranks.exists:
            yield methods(ranks)
        if ranks.exists and (pairs := flips(ranks)):
            yield Markdown("Pairs of methods whose order changes, {}:").format(report.results.headline.axis)
            yield pairs
        if drawn := _ranges(ranks):
            yield "Parameters that were drawn:"
            yield drawn
    yield from figures


def flips(ranks: Ranks) -> Markdown | None:
    """The pairs whose order is the other way in some draw, most often first; empty where there is none."""
    flipping = sorted((pair for pair in ranks.pairs if pair.flips), key=lambda pair: -pair.flips)
    if not flipping:
        return None
    score = ranks.results.headline
    columns = ["nominally better", "than", f"nominally by{score.brackets}", f"over draws by{score.brackets}"]
    columns += ["other way in [% of draws]", "goes with"]
    return table(columns, [_flip(ranks, pair) for pair in flipping])


def _flip(ranks: Ranks, pair: Pair) -> list[str]:
    score = ranks.results.headline
    return [
        pair.first,
        pair.second,
        score.number(pair.nominal, signed=True),
        score.estimate(mean_interval(pair.differences), signed=True),
        percent(pair.flipped),
        favours(pair, pair.cause) if pair.cause else NOTHING,
    ]


def favours(pair: Pair, cause: Cause) -> str:
    """``more crosstalk favours sgd (rho 0.81, p < 0.001)``."""
    gains = pair.first if cause.correlation > 0 else pair.second
    return f"{more(cause)} favours {gains} (rho {abs(cause.correlation):.2f}, {p_value(cause.p)})"


def more(cause: Cause) -> str:
    """More of a parameter, in words."""
    parameter, counted = PARAMETERS[cause.parameter], cause.parameter in COUNTED
    if cause.form in ("sine", "cosine"):
        return f"a larger {cause.form} of the {parameter.words}"
    if cause.form == "size":
        return f"{'more' if counted else 'a larger'} {parameter.words} of either sign"
    signed = " positive" if parameter.low < 0 else ""
    return f"{'more' if counted else 'a more' if signed else 'a larger'}{signed} {parameter.words}"


def sentences(ranks: Ranks) -> list[str]:
    """What the draws say, from their numbers alone."""
    if not ranks.exists:
        return [*left_out(ranks), "No ranking: no draw has two methods with a score for every target."]
    return [*left_out(ranks), *_agreement(ranks), _winner(ranks), *_pairs(ranks)]


def left_out(ranks: Ranks) -> list[str]:
    """Methods and draws that are in no number, and why."""
    lines = []
    unranked = [str(label) for label in ranks.quality if label not in ranks.methods]
    if unranked:
        lines.append(
            "Not ranked, because targets are missing on the nominal display or in more than half of the draws: "
            f"{words(unranked)}."
        )
    empty = set(ranks.empty)
    partly = [index for index in range(len(ranks.swept.points)) if index not in empty and index not in ranks.used]
    if empty and ranks.used:
        lines.append(
            f"{_draws(ranks, sorted(empty))}: no ranked method has a score for every target there, as where the camera "
            "cannot be registered (see Holes). The results hold for benches on which it can be registered."
        )
    if partly and ranks.used:
        lines.append(f"{_draws(ranks, partly)}: a ranked method lacks a target there.")
    return lines


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
        f"{len(taus)} draws. The {len(ranks.methods)} methods keep their nominal order in {ranks.unchanged} of "
        f"{count} draws."
    ]


def _winner(ranks: Ranks) -> str:
    counts = {label: int((ranks.positions[:, index] == 1).sum()) for index, label in enumerate(ranks.methods)}
    winners = [label for label, rank in zip(ranks.methods, ranks.nominal_positions, strict=True) if rank == 1]
    firsts = [f"{counts[label]} of {len(ranks.used)} draws ({percent(ranks.first(label))} %)" for label in winners]
    pairs = zip(winners, firsts, strict=True)
    sentence = f"First on the nominal display: {words([f'{label}, also first in {share}' for label, share in pairs])}"
    others = sorted((label for label in counts if label not in winners and counts[label]), key=lambda x: -counts[x])
    if not others:
        return f"{sentence}. No other method is first in any draw."
    return f"{sentence}. Also first in some draws: {words([f'{label} in {counts[label]}' for label in others])}."


def _pairs(ranks: Ranks) -> list[str]:
    flipping = [pair for pair in ranks.pairs if pair.flips]
    pairs = len(ranks.pairs)
    still = pairs - len(flipping)
    most = 100 * share(0, len(ranks.used)).high
    lines = [
        f"{still} of {pairs} pairs of methods keep their nominal order in every draw; such a pair may still be "
        f"reversed on up to {most:.0f} % of benches (upper end of the interval)."
        if still
        else f"None of the {pairs} pairs of methods keeps its nominal order in every draw."
    ]
    if flipping and ranks.tests:
        known = sum(pair.cause is not None for pair in flipping)
        lines.append(
            f"Of the {len(flipping)} pairs that are reversed in some draw, {known} correlate with a parameter "
            "(Spearman's correlation over draws between its value and the difference of the two means, "
            f"p < {SIGNIFICANCE} after Bonferroni over all {ranks.tests} tests); the table names the strongest. The "
            "others depend on several parameters at once, on the random patterns, or on chance."
        )
    return lines


def _ranges(ranks: Ranks) -> Markdown | None:
    """What was drawn of the draws that are ranked, within which range, and where that comes from."""
    ranked = [ranks.swept.drawn[index] for index in ranks.used] if ranks.swept.drawn else []
    rows = []
    for name in (ranked or [{}])[0]:
        parameter, values = PARAMETERS[name], [draw[name] for draw in ranked]
        limits = f"{parameter.low:.3g} to {parameter.high:.3g}"
        drawn = f"{min(values):.3g} to {max(values):.3g}"
        turn = "; a full turn" if name in CIRCULAR else ""
        rows.append([parameter.words, parameter.unit or "–", limits, drawn, f"{parameter.source}{turn}"])
    return table(["parameter", "unit", "range", "drawn", "source of the range"], rows) if rows else None


def draw(rankings: Sequence[Ranks], folder: Path) -> Iterator[tuple[Path, str]]:
    """Draw a figure for every display that has a ranking; (file, caption) of each."""
    existing = [ranks for ranks in rankings if ranks.exists]
    stems = slugs([ranks.swept.before for ranks in existing])
    for ranks in existing:
        path = folder / f"quality-ranks-{stems[ranks.swept.before]}.png"
        draw_ranks(path, ranks)
        yield path, _caption(ranks)


def _caption(ranks: Ranks) -> str:
    left = (
        f"Ranks of the methods over {len(ranks.used)} draws of {ranks.swept.before}. Left: share of draws [%] in which "
        "a method has each rank; methods in nominal order, nominal ranks framed."
    )
    if not len(ranks.taus):
        return left
    return (
        f"{left} Right: draws by Kendall's tau-b of their ranking against the nominal one. Dot and bar: mean and "
        "95 % interval; dashed: unrelated."
    )


SECTIONS = (
    Section(
        "rank stability",
        60,
        _render,
        applies=lambda report: bool(report.ranks),
        figures=lambda report: draw(report.ranks, report.figures),
    ),
)
