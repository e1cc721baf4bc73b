"""Error budget: which part of the error of captures an image, a network or a field model explains, and which none.

The scores are those of ``metrics.error_budget``; e(P) is what a prediction P leaves unexplained of a capture. The
predictions stand in a chain, each of which is meant to know more than the one before: the target, the ideal image of
the hologram, and the methods of the study in the order of its config. Link k of the chain is, target by target, *the
best of the first k predictions*. So what is explained is nested and never negative, and it is an upper bound: that of
somebody who knew k predictions and, for each target, which of them to believe. A prediction that does worse on a target
than one before it explains nothing of it; what it leaves alone is reported beside the parts.

With e_k of link k, the parts are e_(k-1) - e_k, "what link k explains", then e_K - N, the rest, and N, the temporal
noise, which no prediction can explain; they add up to e_0, the error of the captures against their targets, exactly.
The rest has a sign by chance, since N comes from a second capture. Parts are given as shares of e_0, target by target,
so that a dark picture counts as much as a bright one, as it does in a mean of decibels.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...metrics import error_budget as scores
from ..board import Board
from ..charts.error_budget import draw_budgets
from ..markdown import Markdown, blocks, table_of
from ..results import Results
from ..statistics import Array, Estimate
from ..story import Report, is_many
from ..text import bracketed, percent
from .comparison import CONTROL

ORDER = 10
QUESTION = "Where does the error of the captures come from, and who can remove it?"
TESTS = False
LIMITS = (
    "Bounds: a part is what a prediction explains and none before it does; a hologram gains less from it than its dB.",
    "Parts: image-domain terms are a tone curve, shading, blur and haze, fitted on training captures.",
)


@dataclass(frozen=True)
class Portion:
    """A part of the error. label: who explains it, or what it is; share: of the total; gain: 10 lg (e_0 / e_k), the
    PSNR [dB] that captures without this part and those before it would have gained, and of the noise what captures
    with nothing but noise would, over the targets that have any (None: for the rest, which nobody knows how to remove,
    and where there is no noise);
    alone: share of the total that the prediction leaves by itself (None: of no prediction)."""

    label: str
    share: Estimate
    gain: Estimate | None = None
    alone: Estimate | None = None


@dataclass(frozen=True)
class Budget:
    """The error of the captures of a display. psnr: of the captures against their targets [dB], before the protocol's
    clip; explained: by the links of the chain after the first, that of the ideal image first. All are means over
    targets."""

    condition: str
    psnr: Estimate
    explained: tuple[Portion, ...]
    rest: Portion
    noise: Portion

    @property
    def parts(self) -> tuple[Portion, ...]:
        """All that adds up to the total."""
        return (*self.explained, self.rest, self.noise)


def applies(results: Results) -> bool:
    """Whether the error is split."""
    return results.study.measure == "error_budget"


def budgets(results: Results) -> list[Budget]:
    """The budget of every display on which all methods have the scores for all targets."""
    return [
        _budget(results, condition)
        for condition in results.conditions
        if applies(results)
        and all(results.is_complete(label, condition, scores.PREDICTION) for label in results.methods(condition))
    ]


def _budget(results: Results, condition: str) -> Budget:
    """The budget of a display, see the module."""
    methods, interval = results.methods(condition), results.estimate
    keys = scores.TARGET, scores.IDEAL, scores.NOISE
    target, ideal, noise = (results.values(methods[0], condition, key) for key in keys)
    total = np.maximum(target, scores.SMALLEST)
    predicted = (results.values(label, condition, scores.PREDICTION) for label in methods)
    alone = np.stack([target, ideal, *predicted]) / total
    links = np.minimum.accumulate(alone)
    explained = tuple(
        Portion(label, interval(before - link), interval(-_decibel(link)), interval(left))
        for label, before, link, left in zip(["the ideal image", *methods], links, links[1:], alone[1:], strict=False)
    )
    without = np.where(noise > scores.SMALLEST, _decibel(total) - _decibel(noise), np.nan)
    gain = interval(without) if np.isfinite(without).any() else None
    rest, noisy = Portion("unexplained", interval(links[-1] - noise / total)), interval(noise / total)
    return Budget(condition, interval(-_decibel(total)), explained, rest, Portion("temporal noise", noisy, gain))


def _decibel(error: Array) -> Array:
    return 10 * np.log10(np.maximum(error, scores.SMALLEST))


def verdicts(results: Results) -> Iterator[str]:
    """One a display: the parts of the error, and what its removal is worth. Over many displays, one for all."""
    known = budgets(results)
    if not known:
        yield "No display has the scores of all methods for all targets, so none has a budget."
    for found in [known] if is_many(results) and known else [[budget] for budget in known]:
        shares = {
            part.label: 100 * np.array([b.parts[i].share.mean for b in found]) for i, part in enumerate(found[0].parts)
        }
        *before, last, _, _ = shares
        means = {label: f"{values.mean():z.0f} %" for label, values in shares.items()}
        ends = f" ({shares[last].min():.0f} to {shares[last].max():.0f})" * (len(found) > 1)
        image = sum(shares[label].mean() for label in before)
        rest = [f"{label} {means[label]}" for label in [*shares][-2:]]
        gains = [b.explained[-1].gain.mean for b in found if b.explained[-1].gain]
        begin = f"{found[0].condition}: " if 1 < len(known) != len(found) else ""
        yield (
            f"{begin}Only {last} explains {means[last]}{ends} of the error, what is known of the image {image:.0f} %; "
            f"without both, captures gain {max(gains):.1f} dB at most. By nothing: {' and '.join(rest)}."
        )


def _over(known: list[Budget]) -> dict[str, Array]:
    """The shares of each part on all displays [%]."""
    columns = zip(*(budget.parts for budget in known), strict=True)
    return {parts[0].label: np.array([100 * part.share.mean for part in parts]) for parts in columns}


def table(board: Board) -> Markdown | None:
    """A row a display and part: its share, what removing it and all above it would gain, what it leaves by itself, and
    the control of its model. Over many displays a row a part: the mean and the range of its share."""
    results, known, share = board.results, budgets(board.results), "share of the squared error [%]"
    if is_many(results) and known:
        rows = [
            {
                "explained by": label,
                share: f"{part.mean():.0f}",
                "least to most of displays": f"{part.min():.0f} to {part.max():.0f}",
            }
            for label, part in _over(known).items()
        ]
        return table_of(rows)
    lines = list[Mapping[str, object]]()
    for budget in known:
        for part in budget.parts:
            model = (
                results.rows[part.label, budget.condition] if part.label in results.methods(budget.condition) else None
            )
            line = {
                "display": budget.condition,
                "explained by": part.label,
                share: percent(part.share),
                "PSNR gained, with all above [dB]": bracketed(part.gain, "z.1f"),
                "left by it alone [%]": percent(part.alone),
            }
            control = {score.heading: "–" if model is None else score.in_row(model) for score in results.control}
            lines.append(line | control)
    return blocks([table_of(lines), CONTROL if results.control else None]) if lines else None


def figures(report: Report) -> Iterator[tuple[Path, str]]:
    """Where the error of captures comes from."""
    if known := budgets(report.results):
        path = report.figures / "error-budget.png"
        draw_budgets(path, known)
        yield (
            path,
            "The error budget. Left: parts of the squared error of the captures, by display, with their PSNR. Right: "
            "what removing a part and all parts to its left would gain at most, with its 95 % interval over clusters; "
            "for temporal noise, what captures with no other error would gain.",
        )
