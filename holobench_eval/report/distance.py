"""How far captures of a twin are from photographs: besides noise, as light that is off and out of place."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.optimize import nnls
from torch import Tensor

from ..metrics import match

DARKEST = 1e-9  # mean square that no difference falls below, where a display has no noise


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


@dataclass(frozen=True)
class Compared:
    """A hologram on both: photograph and capture of the twin ``(C, h, w)``, the target, and the photograph's noise."""

    photograph: Tensor
    capture: Tensor
    target: Tensor
    noise: Noise

    @cached_property
    def noise_alone(self) -> Tensor:
        """Mean square of the difference of two photographs that are matched to the target ``(C,)``."""
        factors = match(self.photograph, self.target)[1].double()
        return (2 * self.noise(self.photograph) * factors.square()).clamp_min(DARKEST)

    @cached_property
    def apart(self) -> Tensor:
        """Mean square of the difference of capture and photograph ``(C,)``: the latter is matched to the target, and
        the former to it."""
        first = self.photograph * match(self.photograph, self.target)[1][:, None, None]  # not clipped, as noise is not
        other = self.capture * match(self.capture, first)[1][:, None, None]
        return (other - first).double().square().mean((-2, -1)).clamp_min(DARKEST)

    @cached_property
    def contents(self) -> NDArray[np.float64]:
        """Mean squares of the light of the capture, matched to the target, and of its slope over a pixel ``(C, 2)``."""
        light = (self.capture * match(self.capture, self.target)[1][:, None, None]).double()
        slope = sum(light.diff(dim=axis).square().mean((-2, -1)) for axis in (-2, -1))
        return torch.stack([light.square().mean((-2, -1)), torch.as_tensor(slope)], -1).numpy()


def further(shot: Compared) -> tuple[Tensor, Tensor]:
    """PSNR of a capture against a photograph, and how much lower that is than a second photograph's would be, each
    ``(1 + C,)`` [dB] with all colours first."""
    likeness, bound = (-10 * torch.cat([each.mean()[None], each]).log10() for each in (shot.apart, shot.noise_alone))
    return likeness, bound - likeness


@dataclass(frozen=True)
class Misfit:
    """What a twin is off by besides noise, by colour: the share of the light ``(C,)``, and its place along each axis
    ``(C,)`` [px of the target], both rms and independent from pixel to pixel. Together they tell how much further a
    capture is; one stands for the other where all pictures have details of one size."""

    light: NDArray[np.float64]
    place: NDArray[np.float64]

    @classmethod
    def of(cls, shots: Sequence[Compared]) -> Misfit:
        """By least squares over holograms, none below zero; what is left of each counts by its noise."""
        noise = np.array([shot.noise_alone.numpy() for shot in shots])
        left = np.array([shot.apart.numpy() for shot in shots]) / noise - 1
        contents = np.array([shot.contents for shot in shots]) / noise[..., None]
        squares = np.array([nnls(contents[:, colour], left[:, colour])[0] for colour in range(noise.shape[1])])
        return cls(*np.sqrt(squares).T)
