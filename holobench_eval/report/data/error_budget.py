"""The error of captures in parts: what each prediction explains of it that the one before did not, noise, and the rest.

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

from dataclasses import dataclass

import numpy as np

from ...metrics import error_budget as scores
from ..results import Results
from ..statistics import Array, Estimate

# Labels of the parts that are of no method.
IDEAL_IMAGE, REST, NOISE = "the ideal image", "unexplained", "temporal noise"


@dataclass(frozen=True)
class Part:
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
    explained: tuple[Part, ...]
    rest: Part
    noise: Part

    @property
    def parts(self) -> tuple[Part, ...]:
        """All that adds up to the total."""
        return (*self.explained, self.rest, self.noise)


def budgets(results: Results) -> list[Budget]:
    """The budget of every display on which all methods have the scores for all targets."""
    if results.study.measure != "error_budget":
        return []
    return [
        _budget(results, condition)
        for condition in results.conditions
        if all(results.is_complete(label, condition, scores.PREDICTION) for label in results.methods(condition))
    ]


def _budget(results: Results, condition: str) -> Budget:
    """The budget of a display, see the module."""
    methods, interval = results.methods(condition), results.estimate
    keys = scores.TARGET, scores.IDEAL, scores.NOISE
    target, ideal, noise = (results.values(methods[0], condition, key) for key in keys)
    total, noisy = np.maximum(target, scores.SMALLEST), noise > scores.SMALLEST
    predicted = (results.values(label, condition, scores.PREDICTION) for label in methods)
    alone = np.stack([target, ideal, *predicted]) / total
    links = np.minimum.accumulate(alone)
    return Budget(
        condition=condition,
        psnr=interval(-decibel(total)),
        explained=tuple(
            Part(label, interval(links[k - 1] - links[k]), interval(-decibel(links[k])), interval(alone[k]))
            for k, label in enumerate([IDEAL_IMAGE, *methods], start=1)
        ),
        rest=Part(REST, interval(links[-1] - noise / total)),
        noise=Part(
            NOISE,
            interval(noise / total),
            interval(np.where(noisy, decibel(total) - decibel(noise), np.nan)) if noisy.any() else None,
        ),
    )


def decibel(error: Array) -> Array:
    """10 lg of an error."""
    return 10 * np.log10(np.maximum(error, scores.SMALLEST))
