"""What a display is: its nominal optics, what it is asked for and what it gives back."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal, Protocol

import torch
from torch import Tensor

from ..imaging.register import Registration
from ..optics import AngularSpectrum, FourierLens, Propagator
from ..optics.convolution import frequencies
from ..optics.fourier import picture_pitch
from ..optics.phase import TAU, Matrix, refocus
from ..optics.transfer import transfer_function

Exposure = Literal["equal", "matched"]
Plane = Literal["fresnel", "fourier"]
DARKEST_MEAN = 0.01  # a target channel darker than this is exposed as if it had this mean: exposure stays finite


@dataclass(frozen=True)
class Region:
    """The scored window of the panel, in panel pixels; loss and score both use exactly this window.

    Parameters
    ----------
    top, left
        First row and column.
    height, width
        Rows and columns.

    Examples
    --------
    >>> region = Region(top=1, left=2, height=2, width=3)
    >>> region.crop(torch.zeros(3, 8, 8)).shape
    torch.Size([3, 2, 3])
    >>> float(region.embed(torch.ones(2, 3), (8, 8)).sum())
    6.0
    """

    top: int
    left: int
    height: int
    width: int

    @property
    def shape(self) -> tuple[int, int]:
        """(height, width) in pixels."""
        return self.height, self.width

    def crop(self, image: Tensor) -> Tensor:
        """The window of an image of panel size, ``(..., H, W) -> (..., h, w)``; a view."""
        return image[..., self.top : self.top + self.height, self.left : self.left + self.width]

    def clear_around(self, image: Tensor) -> Tensor:
        """An image of panel size or larger, ``(..., H, W)``, set to zero outside the window, in place."""
        bottom, right = self.top + self.height, self.left + self.width
        for outside in (image[..., : self.top, :], image[..., bottom:, :], image[..., : self.left], image[..., right:]):
            outside.zero_()
        return image

    def embed(self, image: Tensor, shape: tuple[int, int]) -> Tensor:
        """A panel-sized image with ``image`` in the window and zeros elsewhere, ``(..., h, w) -> (..., H, W)``."""
        panel = image.new_zeros((*image.shape[:-2], *shape))
        self.crop(panel).copy_(image)
        return panel


@dataclass(frozen=True)
class DisplaySpec:
    """Nominal optics of a display: all that a method may know about it.

    An off-axis display adds its blaze to every phase and re-centres the image, so the nominal model is on axis. The
    blaze is given for methods that model the panel, whose look-up table and crosstalk meet the phase with the blaze.

    Parameters
    ----------
    name
        That of the profile or of the bench file.
    shape
        Rows and columns of the panel.
    pitch
        Of the panel's pixels [m].
    wavelengths
        One a colour channel [m].
    distance
        From the panel to the image plane [m]; of a Fourier plane, the focal length of the lens between them.
    bits
        Of the panel.
    pupil
        Diameter of the iris as a fraction of the panel's band 1 / pitch, None for no iris; for a Fourier plane, see
        ``optics.fourier.picture_pitch``.
    region
        The scored window.
    eye
        That of the viewer, where its prescription is known: ``focus`` of ``stages.eye.Eye``.
    blaze
        That the display adds, (vertical, horizontal) cycles a pixel.
    levels
        Phase of every level by the maker's table, a colour [rad]; empty: equal steps, ``2^bits`` to a turn.
    frames
        Most frames that the panel shows in one exposure, whose light adds up.
    spectrum
        Lines of the source, a colour, as many of each: offset from its wavelength [m] and share of the power; their
        light adds up in intensity. Empty: a single line.
    plane
        "fresnel": free space between panel and image; "fourier": the back focal plane of a lens.
    """

    name: str
    shape: tuple[int, int]
    pitch: float
    wavelengths: tuple[float, ...]
    distance: float
    bits: int
    pupil: float | None
    region: Region
    eye: Matrix = (0.0, 0.0, 0.0)
    blaze: tuple[float, float] = (0.0, 0.0)
    levels: tuple[tuple[float, ...], ...] = ()
    frames: int = 1
    spectrum: tuple[tuple[tuple[float, float], ...], ...] = ()
    plane: Plane = "fresnel"

    @property
    def image_pitch(self) -> float:
        """From pixel to pixel of the image [m]: that of the panel, or ``optics.fourier.picture_pitch``."""
        if self.plane == "fresnel":
            return self.pitch
        return picture_pitch(self.shape, self.pitch, self.wavelengths, self.distance, self.pupil or 1.0)

    def step(self, channel: int) -> float:
        """From pixel to pixel of the picture of a colour in a Fourier plane [cycles/px of the panel]."""
        return self.image_pitch * self.pitch / (self.wavelengths[channel] * self.distance)

    def level_phases(self, channel: int) -> Tensor:
        """Nominal phase of every level of a colour, ``(2^bits,)`` [rad]. A display shows level ``g`` where it is given
        the phase ``2 pi g / 2^bits``, whatever phase the level has.

        Examples
        --------
        >>> spec = DisplaySpec("binary", (8, 8), 8.2e-6, (532e-9,), 0.1, 1, None, Region(0, 0, 8, 8))
        >>> spec.level_phases(0)
        tensor([0.0000, 3.1416])
        """
        if self.levels:
            return torch.tensor(self.levels[channel])
        return torch.arange(2**self.bits) * (TAU / 2**self.bits)

    def propagator(
        self,
        channel: int,
        dtype: torch.dtype = torch.complex64,
        device: torch.device | str = "cpu",
        offset: float = 0.0,
    ) -> Propagator:
        """The ideal propagator of a colour channel, panel to image plane (cached).

        Parameters
        ----------
        channel
            Index of the wavelength.
        dtype, device
            Those of the fields that it propagates.
        offset
            Of a line from that wavelength [m]: the blaze, a grating, turns it off the axis.
        """
        nominal = _free_space if self.plane == "fresnel" else _through_lens
        return nominal(self, channel, dtype, torch.device(device), offset)

    def transfer(self, channel: int) -> Tensor:
        """Transfer function of ``propagator`` on its padded grid, complex64, where the image is in a Fresnel plane."""
        return _free_space(self, channel, torch.complex64, torch.device("cpu"), 0.0).transfer.values


@lru_cache(maxsize=24)
def _through_lens(
    spec: DisplaySpec, channel: int, dtype: torch.dtype, device: torch.device, offset: float
) -> FourierLens:
    wavelength = spec.wavelengths[channel] + offset
    return FourierLens(spec.shape, spec.pitch, wavelength, spec.distance, spec.image_pitch, dtype, device)


@lru_cache(maxsize=24)
def _free_space(
    spec: DisplaySpec, channel: int, dtype: torch.dtype, device: torch.device, offset: float
) -> AngularSpectrum:
    wavelength = spec.wavelengths[channel] + offset
    model = AngularSpectrum(spec.shape, spec.pitch, wavelength, spec.distance, spec.pupil, dtype=dtype, device=device)
    (fy, fx), added = frequencies(model.padded_shape, spec.pitch, device), []
    if any(spec.eye):
        added.append(refocus(spec.eye, fy, fx, wavelength, spec.distance))
    if offset and any(spec.blaze):
        y, x = (spec.distance * offset * cycles / spec.pitch for cycles in spec.blaze)
        added.append(-TAU * (fy * y + fx * x))
    for phase in added:
        model.transfer = transfer_function(model.transfer.values * torch.polar(torch.ones_like(phase), phase).to(dtype))
    return model


@dataclass(frozen=True)
class Capture:
    """One colour-sequential camera capture, as the camera gives it.

    Parameters
    ----------
    frame
        ``(C, Hs, Ws)`` sensor counts [DN], float32.
    dark, white
        Dark level and saturation level [DN].
    gain
        Per channel, counts above dark that light as strong as the mean incident light on the panel would give [DN].

    Examples
    --------
    >>> capture = Capture(torch.full((1, 2, 2), 612.0), dark=512.0, white=4095.0, gain=(200.0,))
    >>> float(capture.linear().mean())
    0.5
    """

    frame: Tensor
    dark: float
    white: float
    gain: tuple[float, ...]

    def __repr__(self) -> str:
        return f"<capture: counts {tuple(self.frame.shape)}, dark {self.dark:.4g}, saturated from {self.white:.4g}>"

    def linear(self) -> Tensor:
        """``(C, Hs, Ws)`` intensity in units of the mean incident intensity on the panel; dark subtracted in float."""
        gain = torch.tensor(self.gain, dtype=torch.float32, device=self.frame.device).view(-1, 1, 1)
        return (self.frame - self.dark) / gain

    @property
    def saturated(self) -> float:
        """Fraction of saturated samples."""
        return float((self.frame >= self.white).float().mean())


@dataclass(frozen=True)
class RectifiedCapture:
    """A capture brought into the target's frame.

    Parameters
    ----------
    image
        ``(C, h, w)`` linear light; 1 is what a white pixel gets if all light of the panel went into the target.
    capture
        The capture itself.
    saturated
        Fraction of saturated samples.
    efficiency
        Light in the region over light on the panel, mean over channels.
    residual
        Registration residual [region px, rms], worst channel.
    exposure
        Per channel, electrons per unit of light, or the exposure time of a real camera.
    """

    image: Tensor
    capture: Capture
    saturated: float
    efficiency: float
    residual: float
    exposure: tuple[float, ...]

    def __repr__(self) -> str:
        return (
            f"<capture in the target's frame: light {tuple(self.image.shape)}, residual {self.residual:.3g} px, "
            f"saturated {self.saturated:.2%}>"
        )


class Camera(Protocol):
    """A camera that counts its frames."""

    def announce(self, phases: Sequence[Tensor]) -> None:
        """Tell which phases ``(C, H, W)`` [rad] are captured next, so that they can be captured in one go."""

    def capture(self, phase: Tensor) -> Capture:
        """Show ``phase`` ``(C, H, W)`` [rad, any range: the display wraps it] and photograph the image plane.

        Several frames ``(F, C, H, W)`` share the exposure.
        """


class Simulation(Protocol):
    """A bench as its registered camera sees it, without noise."""

    @property
    def gains(self) -> tuple[float, ...]:
        """Phase gains of a frame, equal in weight, whose mean stands for that over flicker."""

    def expected(self, phase: Tensor, target: Tensor, gain: float = 1.0) -> tuple[Tensor, Tensor]:
        """Mean and variance of what is scored, over the noise of the camera; differentiable in the phase.

        It has all that a capture goes through: the sensor's pixels, their response and noise, and the interpolation
        that rectifies it.

        Parameters
        ----------
        phase
            ``(C, H, W)`` [rad].
        target
            ``(C, h, w)`` linear light in [0, 1], which the capture is exposed for.
        gain
            Of the phase in this frame.

        Returns
        -------
        mean, variance
            Each ``(C, h, w)``, in the unit of ``RectifiedCapture.image`` and in its square.
        """


class Display(Protocol):
    """Anything that shows a phase and gives back a capture: a simulated bench, a real one, a trained network."""

    @property
    def seed(self) -> int:
        """What all random numbers of the display depend on."""

    @property
    def spec(self) -> DisplaySpec:
        """Nominal optics, public."""

    @property
    def simulation(self) -> Simulation:
        """The bench itself. CellError where there is none."""

    def session(self, names: tuple[object, ...], target: Tensor) -> Camera:
        """The camera, exposed for ``target`` ``(C, h, w)``, under noise that depends on ``names``."""

    def photograph(
        self, phase: Tensor, target: Tensor, item: str, repeat: int, exposure: Exposure = "equal", label: str = ""
    ) -> RectifiedCapture:
        """Show a phase and bring its capture into the frame of the target: what is scored.

        Parameters
        ----------
        phase
            ``(C, H, W)`` [rad], or frames ``(F, C, H, W)`` that share the exposure.
        target
            ``(C, h, w)`` linear light in [0, 1].
        item, repeat
            What the noise depends on, besides the display's seed.
        exposure
            "equal": the same light for every method; "matched": a metering capture first, then the laser power (of a
            real bench the exposure time) that gives the region the target's mean brightness, as paper section 7 does
            for double-phase holograms.
        label
            Name of the method in error messages.

        Raises
        ------
        CellError
            No display can show the phase, or the camera cannot be registered.
        """

    def rectified(self, capture: Capture, target: Tensor) -> Tensor:
        """A capture in the target's frame, on its device, ``(C, h, w)`` in the unit of ``RectifiedCapture.image``."""


Fiducials = Callable[[Display, Tensor], Mapping[tuple[int, int], Tensor]]
"""Phases ``(C, H, W)`` [rad] of the holograms of a grid ``(C, h, w)`` that registers a display's camera, by name."""


def white_irradiance(target: Tensor, spec: DisplaySpec) -> Tensor:
    """Light at a white pixel if all light of the panel went into the target.

    Parameters
    ----------
    target
        ``(C, h, w)`` linear light in [0, 1].
    spec
        The display's nominal optics.

    Returns
    -------
    Tensor
        ``(C,)``; the mean incident light on the panel is 1.
    """
    share = target.mean((-2, -1)).clamp_min(DARKEST_MEAN) * (target.shape[-2] * target.shape[-1])
    return spec.shape[0] * spec.shape[1] / share


def in_target_frame(capture: Capture, target: Tensor, spec: DisplaySpec, registration: Registration) -> Tensor:
    """A capture as ``(C, h, w)`` in the frame of the target, on its device, in the unit of ``RectifiedCapture``."""
    light = registration.rectify(capture.linear()).to(target.device)
    return light / white_irradiance(target, spec)[: light.shape[0], None, None]


def efficiency(image: Tensor, target: Tensor) -> float:
    """``RectifiedCapture.efficiency`` of its image and the target, both ``(C, h, w)``."""
    return float((image.mean((-2, -1)) / target.mean((-2, -1)).clamp_min(DARKEST_MEAN)).mean())
