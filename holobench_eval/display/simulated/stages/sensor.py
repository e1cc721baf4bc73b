"""The camera integrates, adds its noise and counts (paper 5.1 and 7.2)."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Annotated, ClassVar

import numpy as np
import torch
import torch.nn.functional as F  # noqa: N812
from annotated_types import Interval
from torch import Tensor

from ....core.compiled import usable
from ....core.schema import Metres
from ....imaging.shifts import correlate
from ....optics.blocks import in_blocks
from ....optics.linear import linear
from ..geometry import Geometry
from ..kernels import Plane, box_back_rows, box_rows, count_rows, counts
from ..maps import enlarged
from ..stage import Effect, Stage, percent

if TYPE_CHECKING:
    from ..profile import Profile

IMAGE_SAMPLES = 2  # at most, a pixel and axis of the image; a smaller sensor pixel averages nothing
DARKEST = 1e-6  # of a white pixel, below which the slope of a measured response is not followed


@dataclass(frozen=True)
class Sensor(Stage):
    """A camera sensor.

    pitch: from pixel to pixel [m]; bits: of the converter [bits]; dark: counts without light [DN]; full_well: electrons
    that saturate a pixel [electrons]; read_noise: rms [electrons]; prnu: rms of the pixels' gain [relative];
    vignetting: loss at the corner of the frame [share]; nonlinearity: loss of response at full scale [share]; ambient:
    stray light on every pixel [relative to that of a perfectly reconstructed white one]; headroom: light that fills
    the well [times that of a perfectly reconstructed white pixel]; noise: false for an ideal camera that counts in
    fractions.
    """

    title: ClassVar[str] = "sensor"
    model: ClassVar[str] = (
        "pixel area, vignetting, fixed pattern, shot and read noise, non-linearity, saturation, ADC (paper 5.1, 7.2)"
    )

    pitch: Annotated[float, Metres(0.5e-6, 200e-6)] = 3.72e-6
    bits: Annotated[int, Interval(ge=8, le=16)] = 14
    dark: Annotated[float, Interval(ge=0)] = 512.0
    full_well: Annotated[float, Interval(gt=0)] = 32000.0
    read_noise: Annotated[float, Interval(ge=0)] = 7.0
    prnu: Annotated[float, Interval(ge=0, le=0.2)] = 0.0
    vignetting: Annotated[float, Interval(ge=0, lt=1)] = 0.0
    nonlinearity: Annotated[float, Interval(ge=0, le=0.3)] = 0.0
    ambient: Annotated[float, Interval(ge=0, le=10)] = 0.0
    headroom: Annotated[float, Interval(ge=1, le=1000)] = 8.0
    noise: bool = True

    def effects(self, profile: Profile) -> Iterator[Effect]:
        """Area and response of the pixels, and their noise."""
        size = self.panel_pixels(profile)
        if size * min(profile.sampling, IMAGE_SAMPLES) > 1:
            yield Effect("sensor_area", f"sensor pixels that average over {size:.2g} px")
        if "shading" in self.maps:
            yield Effect("shading", "brightness uneven over the image, as measured")
        if "exponent" in self.maps:
            text = "/".join(f"{value:.3g}" for value in self.maps["exponent"].tolist())
            yield Effect("response", f"response with the exponent {text}, as measured")
        if "ambient" in self.maps:
            yield Effect("offset", "light that is always there, as measured")
        if self.vignetting:
            yield Effect("vignetting", f"vignetting, {percent(self.vignetting)} at the corner")
        if self.prnu:
            yield Effect("fixed_pattern", f"fixed pattern of the sensor, {percent(self.prnu)} rms")
        if self.nonlinearity:
            yield Effect("sensor_response", f"non-linear sensor, {percent(self.nonlinearity)} less at full scale")
        if self.noise:
            yield Effect("noise", f"shot noise of {self.full_well:g} electrons, read noise of {self.read_noise:g}")

    def image(self, light: Tensor, profile: Profile, geometry: Geometry) -> Tensor:
        """The mean over the area of a sensor pixel around each sample, of the light behind a measured shading."""
        samples = light.shape[-2] // geometry.shape[0]
        if (own := self.map_of("shading", geometry.channel)) is not None:
            light = light * self._shading(own, geometry.shape, samples).to(light)
        return box_filter(light, samples * self.panel_pixels(profile))

    def panel_pixels(self, profile: Profile) -> float:
        """Side of a sensor pixel in pixels of the image."""
        return self.pitch / (profile.relay.magnification * profile.spec().image_pitch)

    def _shading(self, own: Tensor, shape: tuple[int, int], samples: int) -> Tensor:
        """At all samples; the last ones lie beyond the centres of the last pixels, and have their values."""
        rows, columns = (samples * (side - 1) + 1 for side in shape)
        inner = enlarged(enlarged(own, shape), (rows, columns)).clamp_min(0)
        beyond = (0, samples - 1, 0, samples - 1)
        return F.pad(inner[None], beyond, mode="replicate")[0]

    def toned(self, light: Tensor, channel: int) -> Tensor:
        """What the sensor makes of light, both 1 at a white pixel, where its response is a measured power."""
        own = self.map_of("exponent", channel)
        return light if own is None else light.clamp_min(DARKEST) ** float(own)

    def surrounding(self, channel: int) -> float:
        """Light on every pixel, of a white one."""
        own = self.map_of("ambient", channel)
        return self.ambient if own is None else self.ambient + float(own)

    @property
    def white(self) -> float:
        """Saturation level [DN]."""
        return 2.0**self.bits - 1

    @property
    def counts_per_electron(self) -> float:
        """Conversion gain [DN / electron]: the full well reaches the saturation level."""
        return (self.white - self.dark) / self.full_well

    def response(self, frame_shape: tuple[int, int], geometry: Geometry) -> Tensor:
        """Relative response ``(Hs, Ws)`` of every pixel: vignetting times fixed-pattern gain."""
        rows, columns = frame_shape
        y = torch.linspace(-1, 1, rows)[:, None]
        x = torch.linspace(-1, 1, columns)[None, :]
        falloff = 1 - self.vignetting * (y * y + x * x) / 2
        pattern = torch.randn(rows, columns, generator=geometry.generator("fixed pattern"))
        return falloff * (1 + self.prnu * pattern)

    def expose(self, light: Tensor, electrons: float, response: Tensor, normal: Tensor, channel: int = 0) -> Tensor:
        """Counts [DN] ``(Hs, Ws)`` of ``light`` (mean incident light on the panel is 1) at ``electrons`` per unit.

        Shot noise is the normal approximation of Poisson noise; its error is below the read noise above 20 e-.
        normal: standard normal numbers ``(Hs, Ws)``, one for the noise of each pixel.
        """
        white = self.full_well / self.headroom  # electrons
        ambient = self.surrounding(channel) * white
        if "exponent" in self.maps:
            light = self.toned(light * (electrons / white), channel) * (white / electrons)
        if not self.noise:
            charge = response * (light * electrons + ambient)
            return (charge * self.counts_per_electron + self.dark).clamp(max=self.white)
        planes = light.numpy(), response.numpy(), normal.numpy()
        bend = self.nonlinearity / self.full_well
        numbers = (self.read_noise**2, bend, self.counts_per_electron, self.dark, self.white)
        if not usable(light):
            return torch.from_numpy(counts(planes[1] * (planes[0] * electrons + ambient), planes[2], *numbers))
        counted = torch.empty(light.shape, dtype=torch.float32, device="cpu")
        count_rows(*planes, electrons, ambient, numbers, counted.numpy())
        return counted

    def expected(self, light: Tensor, response: Tensor, channel: int = 0) -> tuple[Tensor, Tensor]:
        """Mean and variance of what ``expose`` gives above the dark level, differentiable.

        The unit is that of ``light`` ``(Hs, Ws)``: a white pixel, which fills the well to 1 / headroom.
        """
        white = self.full_well / self.headroom  # electrons
        charge = response * white * (self.toned(light, channel) + self.surrounding(channel))
        bent = charge - self.nonlinearity / self.full_well * charge.square() if self.noise else charge
        mean = bent.clamp(max=self.full_well) / white
        if not self.noise:
            return mean, torch.zeros_like(mean)
        rounding = 1 / (12 * self.counts_per_electron**2)
        return mean, (charge.clamp_min(0) + self.read_noise**2 + rounding) / white**2


def box_filter(image: Tensor, width: float) -> Tensor:
    """Mean over a square of ``width`` samples around each sample of ``(..., H, W)``; the sensor's pixel area."""
    if width <= 1:
        return image
    reach = math.ceil((width - 1) / 2)
    edge = (width - (2 * reach - 1)) / 2
    taps = [share / width for share in (edge, *[1.0] * (2 * reach - 1), edge)]
    if usable(image.detach()) and image.ndim == 2 and image.dtype == torch.float32:
        weights = np.array(taps, np.float32)
        return linear(partial(_filtered, box_rows, weights), partial(_filtered, box_back_rows, weights), image)
    flat = F.pad(image.reshape(-1, 1, *image.shape[-2:]), (reach, reach, reach, reach), mode="replicate")
    return correlate(correlate(flat, taps, dim=-2), taps, dim=-1).reshape(image.shape)


def _filtered(filtering: Callable[[Plane, Plane, int, int, Plane], None], taps: Plane, image: Tensor) -> Tensor:
    given, result = image.detach().contiguous().numpy(), torch.empty(image.shape, dtype=image.dtype, device="cpu")
    in_blocks(
        lambda rows: filtering(given, taps, rows.start, rows.stop, result.numpy()), result, len(image), image.numel()
    )
    return result
