"""The simulated bench: every stage between a phase and a camera count, composed from a profile."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial, reduce
from operator import add, mul

import torch
from torch import Tensor

from ...core.device import CPU
from ...core.errors import UserError
from ...core.seeds import generator
from ...optics.blocks import in_blocks
from ...optics.convolution import frequencies
from ...optics.padding import padded_shape
from ...optics.phase import blaze
from ...optics.phasor import squared_modulus
from ...optics.transfer import by_columns
from ..api import Capture, DisplaySpec
from .fourier_path import FourierPath
from .fused_path import FusedPath, quickest
from .geometry import Geometry
from .noise import normal
from .panel_light import PanelLight
from .path import LightPath, OpticalPath
from .profile import Profile
from .stages.propagation import sample_weights
from .stages.relay import finer_grid, sample, sampling_grid
from .stages.sensor import IMAGE_SAMPLES


@dataclass(frozen=True)
class ChannelMaps:
    """What is fixed for one line of the source: every random pattern drawn, every transfer function built.

    power: of the line, relative to what the camera's exposure was set for; light: from a phase to the light of that
    power that leaves the panel; path: all that is linear in it.
    """

    geometry: Geometry
    power: float
    light: PanelLight
    path: LightPath


class SimulatedBench:
    """A display that behaves like hardware. Methods see it through ``session``; only the oracle sees inside.

    Parameters
    ----------
    profile
        Already scaled to its panel. Its name and seed draw every fixed pattern, so that another seed is another bench
        of the same kind.
    device
        Where light is computed, from the phase to what falls on the sensor; what is fixed is drawn and built on the CPU
        and moved there. The sensor counts on the CPU, and so a ``Capture`` is there.

    Examples
    --------
    >>> from holobench_eval.display.simulated.profile import load_profile
    >>> bench = SimulatedBench(load_profile("ideal").scaled((64, 64)))
    >>> bench.intensity(torch.zeros(64, 64), channel=1).shape
    torch.Size([64, 64])
    >>> bench.session("example", exposure=(100.0,) * 3).capture(torch.zeros(3, 64, 64)).frame.dtype
    torch.float32
    """

    def __init__(self, profile: Profile, device: torch.device = CPU) -> None:
        if profile.network.method:
            raise UserError(f"'{profile.name}' is a network: it has no stages to build a bench of or to draw")
        self.profile = profile
        self.device = device
        self.spec: DisplaySpec = profile.spec()
        panel = profile.panel
        self.samples = profile.sampling
        self.image_samples = min(profile.sampling, IMAGE_SAMPLES)
        names = ("bench", profile.name, profile.seed)
        self.ramp = blaze(panel.shape, panel.blaze)
        geometries = [
            Geometry(
                shape=panel.shape,
                pitch=panel.pitch,
                wavelength=wavelength,
                distance=panel.distance,
                samples=self.samples,
                channel=index,
                seed=names,
                blaze=panel.blaze,
                image_pitch=self.spec.image_pitch if panel.plane == "fourier" else None,
            )
            for index, wavelength in enumerate(panel.wavelengths)
        ]
        geometry = geometries[0]
        today = profile.drift.moved(profile, geometry)
        lines = ((self._maps(today, *line) for line in self._lines(each)) for each in geometries)
        self.lines = tuple(tuple(maps) for maps in lines)
        self.channels = tuple(lines[0] for lines in self.lines)
        self.drift_gain = profile.drift.phase_gain(geometry)
        pitches = (self.spec.image_pitch, profile.sensor.pitch)
        points = today.relay.panel_points(panel.shape, *pitches, window=self.spec.region.shape)
        points = today.relay.displaced(points, panel.shape) + torch.tensor(panel.offset)
        self.grid = sampling_grid(points, panel.shape).to(device)
        fine = [self.image_samples * size for size in panel.shape]
        self.fine_grid = finer_grid(self.grid, fine, self.image_samples)
        self.response = profile.sensor.response((points.shape[0], points.shape[1]), geometry)

    def _lines(self, geometry: Geometry) -> list[tuple[float, Geometry]]:
        """Share of the power and geometry of every line of a channel's source."""
        lines = [(1.0, geometry)]
        for stage in self.profile.stages:
            lines = [(part * share, line) for part, source in lines for share, line in stage.spectrum(source)]
        return lines

    def _maps(self, profile: Profile, share: float, geometry: Geometry) -> ChannelMaps:
        stages, ramp, noise = profile.stages, self.ramp, profile.coherent_noise
        demodulation = torch.polar(torch.ones_like(ramp), -ramp)
        incident = reduce(mul, present(stage.panel(geometry) for stage in stages)) * demodulation
        if profile.drift.days:
            incident = incident * profile.drift.dust(geometry, noise).to(incident.dtype)
        power = profile.drift.laser_power(geometry) * profile.illumination.laser(geometry.channel) * share
        modulated, unmodulated = self._amplitudes(geometry.channel)
        return ChannelMaps(
            geometry=geometry,
            power=power,
            light=PanelLight(
                bits=profile.panel.bits,
                channel=geometry.channel,
                lut=profile.lut,
                crosstalk=profile.crosstalk,
                weights=profile.crosstalk.weights(self.samples, geometry.channel),
                modulated=modulated,
                unmodulated=unmodulated,
                added=reduce(add, present(stage.hologram(geometry) for stage in stages), ramp).to(self.device),
                lut_gain=profile.lut.gain_map(geometry).to(self.device),
                incident=(math.sqrt(power) * incident).to(self.device, torch.complex64),
                lut_bend=None if (bend := profile.lut.bend_map(geometry)) is None else bend.to(self.device),
            ),
            path=self._path(profile, geometry),
        )

    def _amplitudes(self, channel: int) -> tuple[Tensor, Tensor]:
        """Of the modulated and of the unmodulated light of each sub-sample, ``(samples, samples, 1, 1)``."""
        aperture, count = self.profile.aperture, self.samples**2
        modulated, unmodulated = self.profile.zero_order.amplitudes(channel)
        active = aperture.active_share(self.samples) if aperture else torch.ones(count, 1, 1)
        dead = aperture.dead_share(self.samples) if aperture else torch.zeros(count, 1, 1)
        grid = (self.samples, self.samples, 1, 1)
        lit, reflected = modulated * active, modulated * dead + unmodulated
        return lit.view(grid).to(self.device), reflected.view(grid).to(self.device, torch.complex64)

    def _path(self, profile: Profile, geometry: Geometry) -> LightPath:
        if geometry.image_pitch is not None:
            return FourierPath(geometry, profile.propagation, self.image_samples, self.device, torch.complex64)
        noise = profile.coherent_noise
        plane, padded = noise.plane(geometry), self._padded()
        turning = 1.0 if plane is None else 1 - noise.plane_distance
        ends = [(0.0, 1.0)] if plane is None else [(0.0, turning), (turning, 1.0)]
        legs = [profile.propagation.transfer(geometry, padded, profile.panel.pupil, leg) for leg in ends]
        rows, columns = sample_weights(padded, self.samples, geometry.blaze, hold=profile.aperture is not None)
        fy, fx = frequencies(padded, geometry.pitch)
        for factor in present(stage.transmission(fy, fx, geometry) for stage in profile.stages):
            legs[-1] = legs[-1] * factor.to(legs[-1].dtype)
        legs = list(map(by_columns, legs))  # the order in memory decides how complex products are rounded
        dust, last = (None, None) if plane is None else (plane - 1, legs[1])
        path = OpticalPath(geometry.shape, rows, columns, legs[0], dust, last, self.image_samples)
        return quickest(path, self.device)

    def _padded(self) -> tuple[int, int]:
        """One size for all channels: that of the longest wavelength, whose light spreads furthest."""
        panel = self.profile.panel
        return padded_shape(panel.shape, panel.pitch, max(panel.wavelengths), panel.distance, panel.pupil, None)

    def intensity(self, phase: Tensor, channel: int, flicker: float = 1.0) -> Tensor:
        """Noise-free intensity at the image plane.

        Parameters
        ----------
        phase
            ``(H, W)`` [rad]; the result is differentiable in it.
        channel
            Index of the colour.
        flicker
            Phase gain of the frame.

        Returns
        -------
        Tensor
            ``(n H, n W)`` for n = ``image_samples``; the mean incident intensity on the panel is 1.
        """
        if tuple(phase.shape) != tuple(self.profile.panel.shape):  # compiled code would read beyond it
            raise ValueError(f"phase is {tuple(phase.shape)}, the panel is {tuple(self.profile.panel.shape)}")
        gain, moments = flicker * self.drift_gain, self.profile.flicker.moments
        light = reduce(
            add, (seen(maps.path, maps.light, phase, gain * m) for maps in self.lines[channel] for m in moments)
        )
        return light if len(moments) == 1 else light / len(moments)

    def integrated(self, phase: Tensor, channel: int, flicker: float = 1.0) -> Tensor:
        """``intensity`` as it falls on the sensor: after what spreads it, averaged over the area of a sensor pixel."""
        light = self.intensity(phase, channel, flicker)
        for stage in self.profile.stages:
            light = stage.image(light, self.profile, self.channels[channel].geometry)
        return light

    def image(self, phase: Tensor) -> Tensor:
        """``integrated`` of every channel at the panel's pixels, ``(C, H, W)``; differentiable."""
        images = [self.integrated(phase[channel], channel) for channel in range(phase.shape[0])]
        return torch.stack(images)[:, :: self.image_samples, :: self.image_samples]

    def session(self, *names: object, exposure: Sequence[float]) -> BenchSession:
        """A display whose noise depends on ``names`` and the frame number; exposure: electrons a unit of light."""
        return BenchSession(self, names, tuple(exposure))

    def photograph(self, phase: Tensor, exposure: Sequence[float], draw: torch.Generator) -> Capture:
        """One colour-sequential capture of ``phase`` ``(C, H, W)`` [rad], or of frames ``(F, C, H, W)``: each has its
        flicker, and the exposure, which has its noise, adds up their light."""
        shown = phase.to(self.device)[None] if phase.ndim == 3 else phase.to(self.device)
        sensor, size = self.profile.sensor, (shown.shape[1], *self.response.shape)
        frames = torch.empty(size, dtype=torch.float32, device="cpu")
        for channel, frame in enumerate(frames):
            parts = (self.integrated(each[channel], channel, self.profile.flicker.gain(draw)) for each in shown)
            light = reduce(add, parts)
            light = light / len(shown) if len(shown) > 1 else light
            key = int(torch.randint(2**63 - 1, (), generator=draw))
            expose = partial(self._expose, light, exposure[channel], key, frame, channel)
            in_blocks(expose, light, len(frame), frame.numel())
        gain = tuple(electrons * sensor.counts_per_electron for electrons in exposure)
        return Capture(frames, sensor.dark, sensor.white, gain[: len(frames)])

    def _expose(self, light: Tensor, electrons: float, key: int, frame: Tensor, channel: int, rows: slice) -> None:
        """Fill rows of a frame ``(Hs, Ws)`` with the counts of ``light``, as ``integrated`` gives it."""
        seen = sample(light, self.fine_grid[rows], 1).cpu()
        noise = normal(key, rows, frame.shape[1])
        frame[rows] = self.profile.sensor.expose(seen, electrons, self.response[rows], noise, channel)


def seen(path: LightPath, light: PanelLight, phase: Tensor, gain: float) -> Tensor:
    """Intensity ``(n H, n W)`` at the image plane, of the light of one line of the source; see ``PanelLight.field``."""
    if isinstance(path, FusedPath) and light.ready(phase):
        return path.intensity(light.rows(phase, gain))
    return squared_modulus(path.forward(light.field(phase, gain)))


def present(tensors: Iterable[Tensor | None]) -> Iterator[Tensor]:
    """Those that are there."""
    return (tensor for tensor in tensors if tensor is not None)


@dataclass
class BenchSession:
    """The bench under named noise: the same names give the same noise, whatever method is shown."""

    bench: SimulatedBench
    names: tuple[object, ...]
    exposure: tuple[float, ...]
    frames: int = 0

    def announce(self, phases: Sequence[Tensor]) -> None:
        """Nothing: a simulated camera is always ready."""

    @torch.no_grad()
    def capture(self, phase: Tensor) -> Capture:
        """Show ``phase`` ``(C, H, W)`` or ``(F, C, H, W)`` [rad] and photograph the image plane."""
        profile = self.bench.profile
        draw = generator("bench noise", profile.name, profile.seed, *self.names, self.frames)
        self.frames += 1
        return self.bench.photograph(phase, self.exposure, draw)
