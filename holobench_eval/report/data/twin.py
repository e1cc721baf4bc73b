"""How a twin compares with its display: the same holograms photographed on one and captured on the other."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.stats import kendalltau
from torch import Tensor

from ...display.simulated.trust import Trust
from ...metrics import match
from ...study.calibration.twin import Photographed, trial_names
from ...study.plan import Cell
from .statistics import Estimate, mean_interval

DARKEST = 1e-9  # mean square that no difference falls below, where a display has no noise


@dataclass(frozen=True)
class Shown:
    """Holograms of a method on one display: scores ``(pictures,)`` [dB]; and, ``(pictures, 1 + colours)`` with all
    colours first, PSNR of captures there against a photograph, and how much lower that is than that of a second
    photograph [dB]."""

    scores: NDArray[np.float64]
    likeness: NDArray[np.float64]
    gaps: NDArray[np.float64]


@dataclass(frozen=True)
class Pair:
    """Score of one method less that of another on the display and on its twin, means over pictures [dB]."""

    first: str
    second: str
    display: Estimate
    twin: Estimate

    @property
    def apart(self) -> float:
        """How far the twin is off."""
        return abs(self.twin.mean - self.display.mean)


@dataclass(frozen=True)
class Trial:
    """A twin that was tried.

    label: of the method whose holograms were made through it; pictures: by name; display: scores on the display
    ``(pictures,)`` by method; twins: by display of the trial and by method; the first is the twin. is_simulated:
    whether the display is.
    """

    name: str
    of: str
    label: str
    photographs: int
    pictures: tuple[str, ...]
    display: Mapping[str, NDArray[np.float64]]
    twins: Mapping[str, Mapping[str, Shown]]
    is_simulated: bool = True

    @property
    def twin(self) -> Mapping[str, Shown]:
        """The twin, by method."""
        return self.twins[self.name]

    def difference(self, label: str, name: str = "") -> Estimate:
        """Score on a display of the trial less score on the display; of the twin's own holograms: its flattery."""
        return mean_interval(self.twins[name or self.name][label].scores - self.display[label])

    def pairs(self, name: str = "") -> list[Pair]:
        """Every pair of methods, on the display and on one of the trial."""
        shown = self.twins[name or self.name]
        return [
            Pair(
                first,
                second,
                mean_interval(self.display[first] - self.display[second]),
                mean_interval(shown[first].scores - shown[second].scores),
            )
            for first, second in itertools.combinations(self.display, 2)
        ]

    def worst(self, name: str = "", learned: bool = False) -> Pair:
        """The pair that a display of the trial has furthest off, of methods without a camera; or with one that has."""
        return max(
            (pair for pair in self.pairs(name) if (self.label in (pair.first, pair.second)) == learned),
            key=lambda pair: pair.apart,
        )

    def tau(self, name: str = "") -> float:
        """Kendall's tau between the orders of methods by their means."""
        means = [
            [float(np.mean(self.display[label])) for label in self.display],
            [float(np.mean(self.twins[name or self.name][label].scores)) for label in self.display],
        ]
        return float(kendalltau(*means).statistic)

    def trust(self) -> Trust:
        """What stands in the profile."""
        flattery = self.difference(self.label)
        gap = {label: round(float(shown.gaps[:, 0].mean()), 2) for label, shown in self.twin.items()}
        error = round((flattery.high - flattery.low) / 2, 2)
        return Trust(self.of, self.photographs, len(self.pictures), gap, round(flattery.mean, 2), error)


def tried(photographed: Photographed, trial: Photographed, name: str) -> Trial:
    """Compare the photographs of a display with the captures of its twin. UserError: a cell of either is missing."""
    pictures = tuple(dict.fromkeys(item for _, item in photographed.own))
    labels = tuple(dict.fromkeys(label for label, _ in photographed.own))
    targets = {item: photographed.target(item) for item in pictures}
    display: dict[str, NDArray[np.float64]] = {}
    twins: dict[str, dict[str, Shown]] = {each: {} for each in trial_names(name, photographed)}
    on_twins = trial.cells()
    noise = {
        item: Noise.of([photographed.pair(*key) for key in photographed.twice if key[1] == item]) for item in pictures
    }
    for label in labels:
        own = {item: [photographed.captures(cell) for cell in same(photographed, label, item)] for item in pictures}
        display[label] = np.array([np.mean([score for _, score in shots]) for shots in own.values()])
        for each, shown in twins.items():
            others = {item: trial.captures(on_twins[each][label, item][0]) for item in pictures}
            likeness, gaps = zip(
                *(further(own[item][0][0], others[item][0], targets[item], noise[item]) for item in pictures),
                strict=True,
            )
            scores = np.array([score for _, score in others.values()])
            shown[label] = Shown(scores, torch.stack(likeness).numpy(), torch.stack(gaps).numpy())
    learned = photographed.learned.provenance["captures"]
    of, is_simulated = photographed.display.name, photographed.display.real is None
    return Trial(name, of, photographed.label, learned, pictures, display, twins, is_simulated)


def same(photographed: Photographed, label: str, item: str) -> list[Cell]:
    """The photographs of the hologram that is shown on the twin: all repeats, or the first of a method whose repeats
    have random starts."""
    return photographed.own[label, item][: None if (label, item) in photographed.twice else 1]


@dataclass(frozen=True)
class Noise:
    """Variance of a photograph, ``a + b I + c I^2`` of its light I: read noise, shot noise and flicker, by colour.

    coefficients: a, b and c, ``(C, 3)``, of all photographs of one exposure.
    """

    coefficients: Tensor

    @classmethod
    def of(cls, pairs: Sequence[Sequence[Tensor]]) -> Noise:
        """Of pairs of photographs ``(C, h, w)`` of one hologram each, in equal brightness, by least squares over all
        pixels."""
        firsts, seconds = (torch.stack(each).double() for each in zip(*pairs, strict=True))
        area = (-2, -1)
        seconds = seconds * ((firsts * seconds).sum(area, True) / seconds.square().sum(area, True).clamp_min(DARKEST))
        light, squares = (
            each.transpose(0, 1).flatten(1) for each in ((firsts + seconds) / 2, (firsts - seconds).square() / 2)
        )
        powers = torch.stack([light**power for power in range(3)], -1)
        return cls(torch.linalg.lstsq(powers, squares[..., None]).solution[..., 0])

    def __call__(self, photograph: Tensor) -> Tensor:
        """Mean variance of a photograph ``(C, h, w)``, ``(C,)``."""
        light = photograph.double().flatten(1)
        means = torch.stack([(light**power).mean(1) for power in range(3)], -1)
        return (self.coefficients * means).sum(1).clamp_min(0)


def further(photograph: Tensor, capture: Tensor, target: Tensor, noise: Noise) -> tuple[Tensor, Tensor]:
    """PSNR of a capture ``(C, h, w)`` against a photograph, and how much lower that is than a second photograph's would
    be, each ``(1 + C,)`` [dB] with all colours first. The photograph is matched to the target, and the capture to the
    photograph."""
    factors = match(photograph, target)[1]
    first = photograph * factors[:, None, None]  # not clipped, as noise is not
    apart = capture * match(capture, first)[1][:, None, None] - first
    second = (2 * noise(photograph) * factors.double().square()).clamp_min(DARKEST)
    other = apart.double().square().mean((-2, -1)).clamp_min(DARKEST)
    likeness, bound = (-10 * torch.cat([each.mean()[None], each]).log10() for each in (other, second))
    return likeness, bound - likeness
