"""A display as a twin has it: ``DisplayModel`` with levels, sub-samples where they are, and a camera.

On ``leto-2020`` at 144 px, held-out holograms are predicted within 1.2 to 2.1 dB of the noise of a capture; by
``DisplayModel`` within 4.9 to 5.8 dB. A hologram wraps where its phase rounds to 2 pi: without levels the wrap is a
pixel beside its place at one pixel in 600, which costs 1.6 to 5 dB, double phases most.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import ClassVar

import torch
from torch import Tensor, nn
from torch.nn import functional

from ...display.api import DisplaySpec
from ...display.estimates import MODES as ALL_MODES
from ...display.simulated.stages.panel import straight_through_level
from ...display.simulated.stages.propagation import sample_weights
from ...imaging.shifts import correlate
from ...optics.phase import TAU
from ...optics.phasor import phasor
from ..calibrated.display_model import SAMPLES, DisplayModel, Maps, enlarged, pupil_modes, sub_samples
from ..calibrated.terms import ImageTerms

FINER = 2  # samples of the image, a pixel and axis, at which its intensity is not undersampled
WINDOW, BETWEEN = 5.0, 15  # px, standard deviation of the window of the interpolation, and where it ends
WIDEST = 12  # samples of the image, to each side, that the camera's blur reaches: six pixels of the panel
FINE = 0.1  # of a step of the smooth maps, that of a pixel
POSE_GRID = 4  # points along an axis of the camera's displacement


class TwinModel(DisplayModel):
    """Phase ``(C, H, W)`` [rad] to the intensity ``(C, 2 H, 2 W)`` in the image plane, two samples a pixel and axis.

    The parameters are those of ``DisplayModel``, on finer grids and with trefoil, and ``specks``, the dirt of single
    pixels. A phase is rounded to the levels of the panel, and its gradient passes. Each sub-sample sends its light from
    its own place and is a small square.
    """

    MODES: ClassVar[Sequence[str]] = ALL_MODES
    GAIN_GRID: ClassVar[int] = 12
    SOURCE_GRID: ClassVar[int] = 64
    SPECK_GRID: ClassVar[int] = 640  # at most, along an axis: a profile has at most 20 MB of maps

    def __init__(self, spec: DisplaySpec) -> None:
        super().__init__(spec)
        channels = len(spec.wavelengths)
        self.gain = nn.Parameter(torch.zeros(channels, self.GAIN_GRID, self.GAIN_GRID))
        self.amplitude = nn.Parameter(torch.zeros(channels, self.SOURCE_GRID, self.SOURCE_GRID))
        self.angle = nn.Parameter(torch.zeros(channels, self.SOURCE_GRID, self.SOURCE_GRID))
        finest = (min(side, self.SPECK_GRID) for side in spec.shape)
        self.specks = nn.Parameter(torch.zeros(2, channels, *finest))
        rows, columns = sample_weights(spec.shape, SAMPLES, spec.blaze, hold=True)
        self.register_buffer("rows", rows, persistent=False)
        self.register_buffer("columns", columns, persistent=False)
        wide = (2 * spec.shape[0], 2 * spec.shape[1])  # what leaves the picture does not come back at its other side
        self.register_buffer("modes", pupil_modes(self.MODES, wide, spec.pupil), persistent=False)

    def over_panel(self, phase: Tensor) -> Tensor:
        """See the class."""
        maps = self._maps()
        return finer(self._image(self._shown(phase, maps), maps, (0.0,) * len(phase)))

    forward = over_panel

    def dirt(self, shape: tuple[int, int]) -> Tensor:
        """Logarithm of the amplitude, and phase [rad], ``(2, C, *shape)``, of the light besides its smooth maps."""
        return FINE * torch.stack([each if each.shape[1:] == shape else enlarged(each, shape) for each in self.specks])

    def illumination(self) -> Tensor:
        """See the base."""
        amplitude, angle = self.dirt(self.spec.shape)
        return super().illumination() * torch.exp(amplitude) * phasor(angle.new_ones(()), angle)

    def _driven(self, phase: Tensor) -> Tensor:
        bits = self.spec.bits
        return super()._driven(straight_through_level(phase, bits) * (TAU / 2**bits))

    def _image(self, shown: Tensor, maps: Maps, offsets: Sequence[float]) -> Tensor:
        height, width = shown.shape[1:]
        panel = self._panel(shown, maps)
        models = (self._propagator(colour, offset) for colour, offset in enumerate(offsets))
        plane = torch.stack([model.forward(field) for model, field in zip(models, panel, strict=True)])
        spectrum = torch.fft.fft2(plane, s=maps.pupil.shape[1:]) * maps.pupil
        return torch.fft.ifft2(spectrum)[:, :height, :width] * maps.amplitude

    def _panel(self, shown: Tensor, maps: Maps) -> Tensor:
        """Field ``(C, H, W)`` of pixels that have the spectrum of all sub-samples of the phase that they show."""
        phases = sub_samples(shown, maps.taps)
        field = phasor(phases.new_ones(()), phases)
        field = (field + torch.view_as_complex(self.undiffracted)[:, None, None, None]) * maps.light[:, None]
        if self.ramp is not None:  # the optical axis follows the blaze
            field = field * phasor(self.ramp.new_ones(()), -self.ramp)
        spectra = torch.fft.fft2(field)
        return torch.fft.ifft2(torch.einsum("jckhw,jh,kw->chw", spectra, self.rows, self.columns))


class TwinCamera(ImageTerms):
    """``ImageTerms`` of an image of two samples a pixel and axis, seen where the registration has left it.

    moved: displacement of the picture [px], rows and columns, ``(2, n, n)``, for all colours. drift: of the picture
    [px in 100 captures]. power: relative, rms, by which that of the light varies from capture to capture; of neither a
    display that was registered just now has any. captures: taken since then.
    """

    places: Tensor
    power: Tensor
    captures = 0

    def __init__(self, spec: DisplaySpec) -> None:
        super().__init__(spec)
        self.moved = nn.Parameter(torch.zeros(2, POSE_GRID, POSE_GRID))
        self.drift = nn.Parameter(torch.zeros(2))
        self.register_buffer("power", torch.zeros(()))
        places = torch.meshgrid(*(torch.arange(side, dtype=torch.float32) for side in spec.shape), indexing="ij")
        self.register_buffer("places", torch.stack(places), persistent=False)

    def forward(self, intensity: Tensor) -> Tensor:
        """Intensity ``(C, 2 H, 2 W)``, 1 at a white pixel, to the capture ``(C, h, w)`` of the region."""
        seen = self._seen(blurred(intensity, self.blur.exp() * FINER))
        return self._counted(self._hazy(seen, intensity[:, ::FINER, ::FINER]))

    def _seen(self, image: Tensor) -> Tensor:
        """An image ``(C, 2 H, 2 W)`` at the displaced pixels, ``(C, H, W)``."""
        _, height, width = self.places.shape
        moved = enlarged(self.moved, (height, width)) + self.drift[:, None, None] * (self.captures / 100)
        at = (self.places + moved) * FINER
        if not image.is_cpu:
            return picked(image, at)
        ends = at.new_tensor([side - 1 for side in image.shape[-2:]])[:, None, None]
        grid = (2 * at / ends - 1).flip(0).permute(1, 2, 0).expand(len(image), -1, -1, -1)
        return functional.grid_sample(image[:, None], grid, "bilinear", "border", align_corners=True)[:, 0]


def picked(image: Tensor, at: Tensor) -> Tensor:
    """Images ``(C, H, W)`` at places ``(2, h, w)`` [px] by bilinear interpolation, with the edges beyond them:
    ``grid_sample`` from pixels picked by index, whose gradient is deterministic on a GPU."""
    down, across = (axis.clamp(0, side - 1) for axis, side in zip(at, image.shape[-2:], strict=True))
    top, left = (axis.floor().clamp_max(side - 2) for axis, side in zip((down, across), image.shape[-2:], strict=True))
    (above, below), (before, after) = (((1 - share)[None], share[None]) for share in (down - top, across - left))
    upper, lower = ([image[:, (top + i).long(), (left + j).long()] for j in (0, 1)] for i in (0, 1))
    return above * (before * upper[0] + after * upper[1]) + below * (before * lower[0] + after * lower[1])


def finer(field: Tensor) -> Tensor:
    """Intensity of a field ``(C, H, W)`` at ``FINER`` samples a pixel and axis, ``(C, 2 H, 2 W)``; dark beyond its
    edges."""
    parts = torch.stack([field.real, field.imag])
    for dim in (-2, -1):
        ends = (0, 0) * (-1 - dim) + (BETWEEN - 1, BETWEEN)
        halfway = correlate(functional.pad(parts, ends), _interpolation(), dim)
        parts = torch.stack([parts, halfway], dim % parts.ndim + 1).flatten(dim - 1, dim)
    return parts.square().sum(0)


@cache
def _interpolation() -> list[float]:
    """Weights of the pixels around a place halfway between two: a sinc behind a Gaussian window, local, so that what
    the edges of a picture cut off does not ripple through it."""
    away = torch.arange(1 - BETWEEN, BETWEEN + 1, dtype=torch.float64) - 1 / FINER
    weights: list[float] = (torch.sinc(away) * torch.exp(-((away / WINDOW) ** 2) / 2)).tolist()
    return weights


def blurred(image: Tensor, widths: Tensor) -> Tensor:
    """Images ``(C, H, W)``, each pixel a mean of those around it, so that flat light stays flat up to the edges.

    widths: standard deviations [px] of the Gaussian weights down and across, ``(C, 2)``; they end at ``WIDEST``.
    """
    away = torch.arange(-WIDEST, WIDEST + 1, device=image.device)
    for axis, width in enumerate(widths.T):
        taps = torch.exp(-((away / width[:, None]) ** 2) / 2)
        kernel = taps.view(len(taps), 1, *((-1, 1) if axis == 0 else (1, -1)))
        ends = (0, 0, WIDEST, WIDEST) if axis == 0 else (WIDEST, WIDEST, 0, 0)
        line = torch.ones_like(image[:, :, :1] if axis == 0 else image[:, :1])
        sums = (functional.conv2d(functional.pad(each, ends), kernel, groups=len(taps)) for each in (image, line))
        image = next(sums) / next(sums)
    return image
