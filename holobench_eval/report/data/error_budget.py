"""The error of captures in parts: what each prediction explains of it that the one before did not, noise, and the rest.

The scores are those of ``metrics.error_budget``; e(P) is what a prediction P leaves unexplained of a capture. The
predictions stand in a chain, each of which is meant to know more than the one before: the target, the ideal image of
the hologram, and the methods of the study in the order of its config. Link k of the chain is *the best of the first k
predictions*, so that a later link is a choice among more and the parts are nested. Which of them is best on a display
is decided by captures of the images that only watched the trainings, and never by the targets: a part is negative where
what was learned on the former does not hold for the latter, and is reported so.

With e_k of link k, the parts are e_(k-1) - e_k, "what link k explains", then e_K - N, the rest, and N, the temporal
noise, which no prediction can explain; they add up to e_0, the error of the captures against their targets, exactly.
The rest has a sign by chance, since N comes from a second capture. Parts are given as shares of e_0, target by target,
so that a dark picture counts as much as a bright one, as it does in a mean of decibels.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...metrics import error_budget as scores
from .results import Results
from .statistics import Array, Estimate, bootstrap_mean

# Labels of the predictions and parts that are of no method.
TARGET, IDEAL_IMAGE, REST, NOISE = "the target", "the ideal image", "unexplained", "temporal noise"


@dataclass(frozen=True)
class Part:
    """A part of the error. label: who explains it, or what it is; share: of the total; gain: 10 lg (e_0 / e_k), the
    PSNR [dB] that captures without this part and those before it would have gained, and of the noise what captures
    with nothing but noise would (None: for the rest, which nobody knows how to remove, and where there is no noise);
    stands: whose prediction stands for it, its own or a better one before it."""

    label: str
    share: Estimate
    gain: Estimate | None = None
    stands: str = ""


@dataclass(frozen=True)
class Budget:
    """The error of the captures of a display. psnr: of the captures against their targets [dB], before the protocol's
    clip; ideal_psnr: the same of the ideal images; explained: by the links of the chain after the first, that of the
    ideal image first. All are means over targets."""

    condition: str
    targets: int
    psnr: Estimate
    ideal_psnr: Estimate
    explained: tuple[Part, ...]
    rest: Part
    noise: Part

    @property
    def parts(self) -> tuple[Part, ...]:
        """All that adds up to the total."""
        return (*self.explained, self.rest, self.noise)


def budgets(results: Results) -> list[Budget]:
    """The budget of every display on which all methods have the scores for all targets."""
    if results.layout.measure != "error_budget":
        return []
    return [
        budget(results, condition)
        for condition in results.conditions
        if all(results.is_complete(label, condition, scores.PREDICTION) for label in results.methods(condition))
    ]


def budget(results: Results, condition: str) -> Budget:
    """The budget of a display, see the module."""
    methods = results.methods(condition)

    def of(label: str, key: str) -> Array:
        return results.values(label, condition, key)

    target, ideal, noise, algorithm = (
        of(methods[0], key) for key in (scores.TARGET, scores.IDEAL, scores.NOISE, scores.ALGORITHM)
    )
    labels = [TARGET, IDEAL_IMAGE, *methods]
    total = np.maximum(target, scores.SMALLEST)
    shares = [np.ones_like(total), ideal / total, *(of(label, scores.PREDICTION) / total for label in methods)]
    watched = [1.0, of(methods[0], scores.HELD_OUT_IDEAL).mean(), *(of(m, scores.HELD_OUT).mean() for m in methods)]
    best = chosen(watched)
    links = [shares[index] for index in best]
    noise = noise / total
    return Budget(
        condition=condition,
        targets=total.size,
        psnr=bootstrap_mean(-decibel(total)),
        ideal_psnr=bootstrap_mean(-decibel(algorithm)),
        explained=tuple(
            Part(
                labels[k],
                bootstrap_mean(links[k - 1] - links[k]),
                bootstrap_mean(-decibel(links[k])),
                labels[best[k]],
            )
            for k in range(1, len(links))
        ),
        rest=Part(REST, bootstrap_mean(links[-1] - noise)),
        noise=Part(NOISE, bootstrap_mean(noise), bootstrap_mean(-decibel(noise)) if noise.all() else None),
    )


def chosen(errors: Sequence[float]) -> list[int]:
    """For every prediction the index of the best until it, the first of equals; itself where errors are unknown (NaN).

    errors: on held-out images, of each prediction.

    Examples
    --------
    >>> chosen([1.0, 0.9, 0.95, 0.4])
    [0, 1, 1, 3]
    """
    if not np.isfinite(errors).all():
        return list(range(len(errors)))
    return [int(np.argmin(errors[: index + 1])) for index in range(len(errors))]


def decibel(error: Array) -> Array:
    """10 lg of an error."""
    return 10 * np.log10(np.maximum(error, scores.SMALLEST))
