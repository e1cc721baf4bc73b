"""Frames of random phase that are supervised by what an eye sees from several places of its pupil.

Choi, Gopakumar, Peng, Kim, O'Toole & Wetzstein, "Time-multiplexed neural holography: a flexible framework for
holographic near-eye displays with fast heavily-quantized spatial light modulators", ACM SIGGRAPH (2022), whose light
fields these are; Chakravarthula, Baek, Schiffers, Tseng, Kuo, Maimone, Matsuda, Cossairt, Lanman & Heide, "Pupil-aware
holography", ACM Trans. Graph. 41(6), 212 (2022); Kim, Nam, Lee, Lee & Lee, "Holographic parallax improves 3D perceptual
realism", ACM Trans. Graph. 43(4), 68 (2024).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, ClassVar

import torch
from annotated_types import Interval
from torch import Tensor

from ...display.api import DisplaySpec
from ...optics.convolution import frequencies, iris
from ..common import Bench, nominal_model, unit_field
from ..losses import intensity_l2
from .random_frames import FromRandomFrames, Loss


@dataclass(frozen=True)
class LightField(FromRandomFrames):
    """Adam on frames that start from random phases, for the squared error of a light field.

    The light field is what an eye sees whose pupil is at several places of the iris: given views of a scene with depth
    (`solve_views`), or a flat picture, which every place sees, in the middle and on rings around it. All views have one
    brightness. SI units throughout.

    Parameters
    ----------
    rings : int
        Rings of places for a flat picture, evenly up to half of the iris' radius; the k-th has 6 k places. Between
        places that are far apart no loss holds the picture.
    pupil : float
        Diameter of the eye's pupil, as a share of the iris'.
    """

    rings: Annotated[int, Interval(ge=0, le=8)] = 2
    pupil: Annotated[float, Interval(gt=0, le=1)] = 0.5

    title: ClassVar[str] = "frames of random phase for a light field, Choi 2022"
    fresnel: ClassVar[bool] = True
    views: ClassVar[bool] = True

    def loss(self, target: Tensor, bench: Bench, channel: int) -> Loss:
        """The squared error of a flat picture at all places."""
        places = [(0.0, 0.0)]
        for ring in range(1, self.rings + 1):
            angles = (math.tau * (place + 0.5) / (6 * ring) for place in range(6 * ring))
            radius = ring / self.rings / 2
            places += [(radius * math.sin(angle), radius * math.cos(angle)) for angle in angles]
        return self._light_field_loss(target.expand(len(places), *target.shape), places, bench, channel)

    def solve_views(self, targets: Tensor, places: Sequence[float], bench: Bench) -> Tensor:
        """Linear intensities ``(V, C, h, w)`` in [0, 1], seen by a pupil at places sideways from the axis [radii of the
        iris], to a phase ``(C, H, W)``, or of several frames ``(F, C, H, W)`` [rad]."""
        axial = [(0.0, place) for place in places]
        return self.of_scene(targets, bench, lambda views, colour: self._light_field_loss(views, axial, bench, colour))

    def _light_field_loss(
        self, views: Tensor, places: Sequence[tuple[float, float]], bench: Bench, channel: int
    ) -> Loss:
        """The squared error of views ``(V, B, h, w)`` (Choi et al. 2022, the loss of light fields)."""
        model, region = nominal_model(bench, channel, views[0]), bench.spec.region
        pupils = self._pupils(bench.spec, places).to(views.device, views.dtype)
        wanted = torch.cat([*views], dim=-2)  # one under another, so that one factor is for all of them

        def loss(phase: Tensor) -> Tensor:
            spectrum = torch.fft.fft2(model.forward(unit_field(phase)).unflatten(0, (-1, self.frames)))
            seen = (region.crop(torch.fft.ifft2(spectrum * pupil)).abs().square().mean(1) for pupil in pupils)
            return intensity_l2(torch.cat(list(seen), dim=-2), wanted).repeat_interleave(self.frames)

        return loss

    def _pupils(self, spec: DisplaySpec, places: Sequence[tuple[float, float]]) -> Tensor:
        """Amplitude ``(V, H, W)`` of the eye's pupil at every place, over the frequencies of the image."""
        band = spec.pupil or 1.0
        fy, fx = frequencies(spec.shape, spec.pitch)
        radius = band / (2 * spec.pitch)  # of the iris [1/m]
        centres = [(down * radius, right * radius) for down, right in places]
        return torch.stack([iris(fy - y, fx - x, spec.pitch, self.pupil * band) for y, x in centres])
