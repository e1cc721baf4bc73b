"""Light that is scattered on its way arrives as a veil over the image (paper 5.1, Fig. 4C)."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, ClassVar

import torch
from annotated_types import Interval
from torch import Tensor

from ..geometry import Geometry
from ..stage import Effect, Stage, percent

if TYPE_CHECKING:
    from ..profile import Profile


@dataclass(frozen=True)
class StrayLight(Stage):
    """A share of the light arrives spread by a Gaussian, and adds in intensity; its total stays.

    share: that is spread [share of the light]; reach: standard deviation of the Gaussian [panel heights]. What is
    scattered beyond the image is lost.
    """

    title: ClassVar[str] = "stray light"
    model: ClassVar[str] = "a share of the light scattered over a broad Gaussian, adding in intensity (paper Fig. 4C)"

    share: Annotated[float, Interval(ge=0, le=1)] = 0.0
    reach: Annotated[float, Interval(ge=0.01, le=10)] = 0.1

    def effects(self, profile: Profile) -> Iterator[Effect]:
        """Its share and reach."""
        if "blur" in self.maps:
            yield Effect("blur", "blur of the image, as measured")
        if "share" in self.maps or "reach" in self.maps:
            shares = ", ".join(percent(self.veil(channel)[0]) for channel in range(len(profile.panel.wavelengths)))
            yield Effect("stray_light", f"{shares} of the light scattered, as measured")
        elif self.share:
            text = f"{percent(self.share)} of the light scattered over {self.reach:g} panel heights"
            yield Effect("stray_light", text)

    def veil(self, channel: int) -> tuple[float, float]:
        """Share that is spread, and its reach [panel heights]."""
        share, reach = self.map_of("share", channel), self.map_of("reach", channel)
        return self.share if share is None else float(share), self.reach if reach is None else float(reach)

    def image(self, light: Tensor, profile: Profile, geometry: Geometry) -> Tensor:
        """The light with its veil."""
        share, reach = self.veil(geometry.channel)
        widths = self.map_of("blur", geometry.channel)
        sharp = light if widths is None else blurred(light, widths.tolist(), light.shape[-2] // geometry.shape[0])
        if not share:
            return sharp
        spread = max(1.0, reach * light.shape[-2])  # a narrower one would not keep the power
        return (1 - share) * sharp + share * gaussian(light, spread)


def blurred(light: Tensor, widths: Sequence[float], per_pixel: int) -> Tensor:
    """An image ``(n H, n W)``, n samples a pixel and axis, under a Gaussian of standard deviations ``widths`` along
    columns and rows [px]; flat light stays flat."""
    down, along = (_means(side, per_pixel * width, light) for side, width in zip(light.shape, widths, strict=True))
    return down @ light @ along.T


def _means(side: int, width: float, like: Tensor) -> Tensor:
    places = torch.arange(side, dtype=torch.float64)
    weights = torch.exp(-((places[:, None] - places) ** 2) / (2 * max(width, 1e-3) ** 2))
    return (weights / weights.sum(1, keepdim=True)).to(like)


def gaussian(light: Tensor, spread: float) -> Tensor:
    """An image ``(H, W)`` convolved with a Gaussian of standard deviation ``spread`` [samples]; dark around it.

    The Gaussian is two narrower ones in a row, and one every that many samples of them is enough: the error is
    2e-4 of the Gaussian's height, since the trapezoidal rule converges exponentially for it.
    """
    rows, columns = (_narrower(side, spread / math.sqrt(2), light.device) for side in light.shape)
    # in double precision, in which the order of a sum, and so the number of threads, is lost in the rounding
    return (rows.T @ (rows @ light.double() @ columns.T) @ columns).to(light.dtype)


def _narrower(side: int, spread: float, device: torch.device) -> Tensor:
    """Gaussians ``(centres, side)``, one every ``spread`` samples, as far beyond the ends as they reach."""
    places = torch.arange(side, dtype=torch.float64)
    centres = torch.arange(-4 * spread, side + 4 * spread, spread, dtype=torch.float64)
    gaussians = torch.exp(-((places - centres[:, None]) ** 2) / (2 * spread**2))
    return (gaussians / math.sqrt(2 * math.pi * spread)).to(device)
