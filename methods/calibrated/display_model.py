"""A display in a few hundred numbers that mean something, learned from captures.

The deviations that Chakravarthula et al. 2020 list in Section 3 and gather in E_err (Eq. 5-10), each as a stage with
parameters of its own, so that Eq. 13, |P(H) + R|^2, is kept as it stands: a complex field that interferes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache
from typing import ClassVar, NamedTuple

import torch
from torch import Tensor, nn
from torch.nn import functional
from torch.nn.utils import parameters_to_vector

from ...core.graphs import is_recorded
from ...display.api import DisplaySpec
from ...imaging.shifts import correlate_each
from ...optics import Propagator
from ...optics.phase import TAU, blaze, wrap
from ...optics.phasor import mean_phasor, phasor
from ...optics.zernike import NAMES, zernike

# Of the look-up table: levels where its deviation is learned; linear between them.
KNOTS = 17
# Sub-samples of a pixel along an axis: the fewest that turn wrap edges into ramps.
SAMPLES = 3
# Neighbours to each side that crosstalk reaches, in pixels.
REACH = 2
# Points along an axis of the maps of phase gain and of illumination, interpolated between them.
GAIN_GRID, SOURCE_GRID = 4, 24
# Zernike polynomials of the aberration, see optics.zernike.
MODES = ("defocus", "astigmatism_45", "astigmatism_0", "coma_y", "coma_x", "spherical")
FIRST_CROSSTALK = 0.3
# Effects (Profile.effects) that the model, with its haze (terms.py), has a term for. All others of a bench lie outside
# its form: fringes, of which SOURCE_GRID follows the coarser ones alone, and the light from between the pixels as far
# as it is not simply unmodulated, are among them.
FORM = frozenset(
    {
        *("blaze", "look_up_table", "gain_map", "crosstalk", "beam", "wavefront", "tilt", "zero_order", "drift"),
        *MODES,
        *("stray_light", "offset"),
    }
)


class Maps(NamedTuple):
    """What a display does to any phase: factor of the phase and light ``(C, H, W)`` over the panel, share of the
    neighbours in each sub-sample ``(C, samples, 2 reach + 1)``, phasors of the pupil and amplitude ``(C, ...)``."""

    gain: Tensor
    taps: Tensor
    light: Tensor
    pupil: Tensor
    amplitude: Tensor


class DisplayModel(nn.Module):
    """Phase to intensity for one display, all colours; every parameter is per colour.

    table: deviation of the look-up table [rad] at ``KNOTS`` levels. gain: logarithm of the phase gain over the panel.
    crosstalk: logarithm of the width [pixels] of the Gaussian by which fringing fields blur the phase. amplitude,
    angle: logarithm of the amplitude and phase [rad] of the illumination. undiffracted: real and imaginary part of the
    light that the panel does not modulate. aberration: Zernike coefficients [rad]. brightness: logarithm of the
    camera's gain.
    """

    MODES: ClassVar[Sequence[str]] = MODES
    ramp: Tensor | None

    def __init__(self, spec: DisplaySpec) -> None:
        super().__init__()
        channels = len(spec.wavelengths)
        self.spec = spec
        self.table = nn.Parameter(torch.zeros(channels, KNOTS))
        self.gain = nn.Parameter(torch.zeros(channels, GAIN_GRID, GAIN_GRID))
        self.crosstalk = nn.Parameter(torch.full((channels,), math.log(FIRST_CROSSTALK)))
        self.amplitude = nn.Parameter(torch.zeros(channels, SOURCE_GRID, SOURCE_GRID))
        self.angle = nn.Parameter(torch.zeros(channels, SOURCE_GRID, SOURCE_GRID))
        self.undiffracted = nn.Parameter(torch.zeros(channels, 2))
        self.aberration = nn.Parameter(torch.zeros(channels, len(self.MODES)))
        self.brightness = nn.Parameter(torch.zeros(channels))
        self.register_buffer("modes", pupil_modes(self.MODES, spec.shape, spec.pupil), persistent=False)
        self.register_buffer("ramp", blaze(spec.shape, spec.blaze) if any(spec.blaze) else None, persistent=False)
        self._held: tuple[Tensor, Maps] | None = None

    def __getstate__(self) -> dict[str, object]:
        return self.__dict__ | {"_held": None}  # copies compute their own

    def forward(self, phase: Tensor) -> Tensor:
        """Field ``(C, h, w)`` in the region for a phase ``(C, H, W)`` [rad]; its intensity is in the captures' unit."""
        return self.spec.region.crop(self.over_panel(phase))

    def over_panel(self, phase: Tensor) -> Tensor:
        """The same in the entire image plane, ``(C, H, W)``."""
        maps = self._maps()
        return self._image(self._shown(phase, maps), maps, (0.0,) * len(phase))

    def _shown(self, phase: Tensor, maps: Maps) -> Tensor:
        """Phase that the panel has at the nominal wavelengths, ``(C, H, W)``."""
        return self._driven(phase if self.ramp is None else phase + self.ramp) * maps.gain

    def _image(self, shown: Tensor, maps: Maps, offsets: Sequence[float]) -> Tensor:
        """Field ``(C, H, W)`` of a line beside each wavelength [m], of the phase that the panel has."""
        panel = lit(shown, maps.taps, self.spec.blaze)
        panel = (panel + torch.view_as_complex(self.undiffracted)[:, None, None]) * maps.light
        if self.ramp is not None:  # the optical axis follows the blaze
            panel = panel * phasor(self.ramp.new_ones(()), -self.ramp)
        models = (self._propagator(colour, offset) for colour, offset in enumerate(offsets))
        plane = torch.stack([model.forward(field) for model, field in zip(models, panel, strict=True)])
        return torch.fft.ifft2(torch.fft.fft2(plane) * maps.pupil) * maps.amplitude

    def _maps(self) -> Maps:
        """Computed once for parameters that are constants, as in a retrieval; anew after one has changed.

        Values are compared, as torch does not count what is changed through ``data`` or NumPy. A GPU would have to be
        waited for, which recorded steps must not (core.graphs): there the maps are computed each time.
        """
        if is_recorded(self.table.device) or any(parameter.requires_grad for parameter in self.parameters()):
            return self._fresh_maps()
        with torch.inference_mode(False):  # a later step may need gradients
            now = parameters_to_vector(self.parameters())
            if self._held is None or self._held[0].dtype != now.dtype or not torch.equal(self._held[0], now):
                self._held = now, self._fresh_maps()
        return self._held[1]

    def _fresh_maps(self) -> Maps:
        turned = torch.einsum("cm,mhw->chw", self.aberration, self.modes)
        return Maps(
            torch.exp(enlarged(self.gain, self.spec.shape)),
            self._taps(),
            self.illumination(),
            phasor(turned.new_ones(()), turned),
            torch.exp(self.brightness / 2)[:, None, None],
        )

    def _propagator(self, channel: int, offset: float) -> Propagator:
        return self.spec.propagator(channel, device=self.table.device, offset=offset)

    def _driven(self, phase: Tensor) -> Tensor:
        """Phase that each level stands for, by the look-up table."""
        level = wrap(phase) * ((KNOTS - 1) / TAU)
        below = level.detach().floor().clamp_max(KNOTS - 2)
        rows = below.long().flatten(1)
        low, high = (self.table.gather(1, rows + step).view_as(level) for step in (0, 1))
        between = level - below
        return level * (TAU / (KNOTS - 1)) + low + (high - low) * between

    def _taps(self) -> Tensor:
        """Share of each neighbouring pixel in each sub-sample, ``(C, samples, 2 reach + 1)``, along one axis."""
        device = self.crosstalk.device
        position = (torch.arange(SAMPLES, device=device) - (SAMPLES - 1) / 2) / SAMPLES
        offset = torch.arange(-REACH, REACH + 1, device=device)[None] - position[:, None]
        scale = torch.exp(self.crosstalk)[:, None, None] * math.sqrt(2)
        share = torch.erf((offset + 0.5) / scale) - torch.erf((offset - 0.5) / scale)
        return share / share.sum(-1, keepdim=True)

    def illumination(self) -> Tensor:
        """Amplitude and phase of the light on the panel, ``(C, H, W)`` complex, without the camera's gain."""
        shape = self.spec.shape
        return torch.exp(enlarged(self.amplitude, shape)) * phasor(self.angle.new_ones(()), enlarged(self.angle, shape))


def lit(phase: Tensor, taps: Tensor, cycles: tuple[float, float] = (0.0, 0.0)) -> Tensor:
    """Light that each pixel sends along a blaze, ``(C, H, W)``: the mean over its sub-samples, at which the phase
    ``(C, H, W)`` [rad] is that of square pixels convolved with a Gaussian, less the blaze within the pixel.

    taps: share of each neighbouring pixel in each sub-sample, ``(C, samples, 2 reach + 1)``, along one axis; cycles:
    the blaze, (vertical, horizontal) cycles a pixel.
    """
    within = blaze((SAMPLES, SAMPLES), (cycles[0] / SAMPLES, cycles[1] / SAMPLES)).to(phase)
    within = (within - within[SAMPLES // 2, SAMPLES // 2]).reshape(-1, 1, 1)
    if not is_recorded(phase.device) and not taps.requires_grad:  # half the time of what follows
        padded = functional.pad(phase[None], (REACH,) * 4, mode="replicate")
        pairs = zip(padded[0], taps.tolist(), strict=True)
        blurred = (correlate_each(correlate_each(colour, own, -2), own, -1).flatten(0, 1) for colour, own in pairs)
        turned = (colour - within for colour in blurred) if any(cycles) else blurred
        return torch.stack([mean_phasor(colour, 0) for colour in turned])
    return mean_phasor(sub_samples(phase, taps).transpose(0, 1).flatten(1, 2) - within, 1)


def sub_samples(phase: Tensor, taps: Tensor) -> Tensor:
    """The phase ``(C, H, W)`` at sub-samples, ``(samples, C, samples, H, W)``, rows first; taps: as in ``lit``."""
    channels = len(phase)
    padded = functional.pad(phase[None], (REACH,) * 4, mode="replicate")
    rows = functional.conv2d(padded, taps.reshape(channels * SAMPLES, 1, -1, 1), groups=channels)
    rows = rows.view(channels, SAMPLES, *rows.shape[-2:]).transpose(0, 1)  # colours side by side again
    columns = functional.conv2d(rows, taps.reshape(channels * SAMPLES, 1, 1, -1), groups=channels)
    return columns.view(SAMPLES, channels, SAMPLES, *columns.shape[-2:])


def enlarged(grid: Tensor, shape: tuple[int, int]) -> Tensor:
    """A coarse map ``(C, n, n)`` as a smooth one ``(C, H, W)``."""
    return _bicubic(grid[None], shape)[0] if grid.is_cpu else weighted(grid, shape)


def weighted(grid: Tensor, shape: tuple[int, int]) -> Tensor:
    """``enlarged`` as two products with matrices: bicubic interpolation has no deterministic gradient on a GPU."""
    rows, columns = (_weights(grid.shape[-1], side, grid.device, grid.dtype) for side in shape)
    return rows.T @ grid @ columns


@cache
def _weights(points: int, side: int, device: torch.device, dtype: torch.dtype) -> Tensor:
    """What each point alone becomes along an axis, ``(points, side)``; a recorded step could not copy it to a GPU."""
    with torch.inference_mode(False):
        return _bicubic(torch.eye(points)[:, None, :, None], (side, 1))[:, 0, :, 0].to(device, dtype)


def _bicubic(images: Tensor, shape: tuple[int, int]) -> Tensor:
    return functional.interpolate(images, size=shape, mode="bicubic", align_corners=True)


def pupil_modes(names: Sequence[str], shape: tuple[int, int], pupil: float | None) -> Tensor:
    """Polynomials of Zernike on the frequencies of an image ``(h, w)``, zero outside the iris."""
    edge = (pupil or 1.0) / 2  # cycles a pixel
    y, x = torch.meshgrid(*(torch.fft.fftfreq(side, dtype=torch.float64) / edge for side in shape), indexing="ij")
    inside = (torch.hypot(x, y) <= 1).double()
    return torch.stack([zernike(NAMES[name], y * inside, x * inside) * inside for name in names]).float()
