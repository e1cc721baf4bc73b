"""Wirtinger holography through two numbers of the display: the baseline of every method that learns a display.

A share of the light arrives as a veil, spread over a reach: stray light, whoever sent it. The numbers are fitted to
captures of patterns with large dark areas, since only there does a veil differ from tone: it lights what no hologram
lights.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import torch
from annotated_types import Interval
from torch import Tensor

from ...display.api import Region
from ...display.metered import MeteredDisplay
from ...display.nominal import ideal_light
from ...display.training import TrainingBench, TrainingImage
from ..calibrated.patterns import dark_patterns
from ..calibrated.terms import scattered
from ..common import TINY, Offset, nominal_model, per_channel, with_offset
from ..descent import adam
from ..losses import intensity_l2
from ..wirtinger import Objective, Wirtinger

REACHES = tuple(2 ** (step / 8) / 64 for step in range(49))  # panel heights, 1/64 to 1
SHARES = 200  # from 0 to 1 that are tried


@dataclass(frozen=True)
class WirtingerVeil:
    """Wirtinger holography through a veil whose share and reach are fitted to captures of three patterns.

    The phase of the least squared error between the target and ``(1 - s) I + s V * I``, with the intensity I of the
    nominal model, the share s of the light and a Gaussian V. SI units throughout.

    Parameters
    ----------
    iterations : int
        Evaluations of loss and gradient.
    step : float
        Adam's step [rad].
    offset : {"none", "centre"}
        Constant phase that is added in the end. none: zero; centre: the one that brings the phase of the fewest pixels
        to the wrap between 0 and 2 pi, whose edges a panel blurs.
    """

    iterations: Annotated[int, Interval(ge=1, le=100_000)] = 200
    step: Annotated[float, Interval(gt=0, le=10)] = 0.1
    offset: Offset = "centre"

    title: ClassVar[str] = "Wirtinger holography through a veil of two numbers"
    trains: ClassVar[bool] = True
    version: ClassVar[int] = 2
    form: ClassVar[frozenset[str]] = frozenset({"stray_light"})

    def prepare(self, bench: TrainingBench) -> Mapping[str, Any]:
        """Photograph Wirtinger holograms of the patterns, and fit the veil.

        Parameters
        ----------
        bench : TrainingBench
            The display, and a memory that survives a kill.

        Returns
        -------
        mapping
            ``share`` of the light, and ``reach``, the standard deviation of the veil [panel heights].

        Raises
        ------
        BudgetError
            When no capture is left.
        """
        spec = bench.spec
        gray = torch.full((len(spec.wavelengths), *spec.region.shape), 0.5, device=bench.device)
        images = [TrainingImage(name, light.expand_as(gray)) for name, light in dark_patterns(gray[0]).items()]
        phases = [bench.solved(Wirtinger(), image) for image in images]
        shots = [
            (phase, TrainingImage(image.item, gray), ("veil",)) for phase, image in zip(phases, images, strict=True)
        ]

        def photographed() -> dict[str, Tensor]:
            bench.announce(shots)
            return {"captures": torch.stack([bench.photograph(phase, image, *names) for phase, image, names in shots])}

        captures = bench.kept("captures", photographed)["captures"]
        ideal = torch.stack([ideal_light(phase, spec) for phase in phases])
        share, reach = fitted(ideal, captures, spec.region)
        bench.log(round=1, step=1, share=share, reach=reach)
        return {"share": share, "reach": reach}

    def solve(self, target: Tensor, bench: MeteredDisplay) -> Tensor:
        """Phases ``(B, C, H, W)`` [rad] of the least loss that was seen through the veil.

        target: linear intensity ``(B, C, h, w)`` in [0, 1]. CellError: it was not trained.
        """
        share, reach = bench.learned["share"], bench.learned["reach"]

        def retrieve(target: Tensor, channel: int) -> Tensor:
            model, region = nominal_model(bench, channel, target), bench.spec.region

            def loss(intensity: Tensor, target: Tensor) -> Tensor:
                return intensity_l2(region.crop(veiled(intensity, share, reach)), target)

            objective = Objective(model, Region(0, 0, *bench.spec.shape), target, loss)
            start = target.new_zeros((len(target), *bench.spec.shape))
            return with_offset(adam(start, objective.evaluate, self.iterations, self.step), self.offset)

        return per_channel(target, retrieve)


def veiled(intensity: Tensor, share: float, reach: float) -> Tensor:
    """An intensity ``(..., H, W)`` with its veil; it is dark beyond the picture."""
    return (1 - share) * intensity + share * scattered(intensity, reach * intensity.shape[-2])


def fitted(ideal: Tensor, captures: Tensor, region: Region) -> tuple[float, float]:
    """Share and reach of the veil with which ideal intensities ``(n, C, H, W)`` come nearest to captures
    ``(n, C, h, w)`` of the region, in the squared error, at the best brightness of each colour and with the best
    constant, such as a camera's black level.

    Every reach of `REACHES` and every share of `SHARES` is tried.
    """
    shares = torch.linspace(0, 1, SHARES, device=ideal.device, dtype=torch.float64)
    errors = []
    for reach in REACHES:
        light, veil, seen = (
            (row := part.double().transpose(0, 1).flatten(1)) - row.mean(1, keepdim=True)  # a row a colour
            for part in (region.crop(ideal), region.crop(scattered(ideal, reach * ideal.shape[-2])), captures)
        )
        a, b = 1 - shares[:, None], shares[:, None]
        overlap = a * (light * seen).sum(1) + b * (veil * seen).sum(1)
        power = a**2 * (light**2).sum(1) + 2 * a * b * (light * veil).sum(1) + b**2 * (veil**2).sum(1)
        errors.append(((seen**2).sum(1) - overlap**2 / power.clamp_min(TINY)).sum(1))
    best = int(torch.stack(errors).argmin())
    return float(shares[best % SHARES]), REACHES[best // SHARES]
