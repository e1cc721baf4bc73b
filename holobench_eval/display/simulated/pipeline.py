"""The simulated bench: every stage between a phase and a camera count, composed from a profile."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from ...core.device import CPU
from ...core.seeds import generator
from ...optics.convolution import by_columns, frequencies
from ...optics.padding import padded_shape
from ...optics.phase import blaze, refocus
from ...optics.phasor import phasor, squared_modulus
from ..api import Capture, DisplaySpec
from .path import Dust, OpticalPath, panel_spectrum
from .profile import Profile
from .stages import Geometry, Relay
from .stages.propagation import sample_weights
from .stages.quantise import straight_through_level
from .stages.relay import box_filter, sample, sampling_grid


@dataclass(frozen=True)
class ChannelMaps:
    """What is fixed for one colour channel: every random pattern drawn, every transfer function built.

    added: phase [rad] that the display adds to every hologram; lut_gain; amplitude and angle [rad] of the incident
    light: ``(H, W)``; path: all that is linear in the light, and the light that no phase changes.
    """

    geometry: Geometry
    added: Tensor
    lut_gain: Tensor
    amplitude: Tensor
    angle: Tensor
    path: OpticalPath
    laser_power: float

    def to(self, device: torch.device) -> ChannelMaps:
        """The same on a device."""
        return replace(
            self,
            added=self.added.to(device),
            lut_gain=self.lut_gain.to(device),
            amplitude=self.amplitude.to(device),
            angle=self.angle.to(device),
            path=self.path.to(device),
        )


class SimulatedBench:
    """A display that behaves like hardware. Methods see it through ``session``; only the oracle sees inside.

    profile: already scaled to its panel. Its name and seed draw every fixed pattern, so that another seed is another
    bench of the same kind. device: where light is computed, from the phase to what falls on the sensor; what is fixed
    is drawn and built on the CPU and moved there. The sensor counts on the CPU, and so a ``Capture`` is there.
    """

    def __init__(self, profile: Profile, device: torch.device = CPU) -> None:
        self.profile = profile
        self.device = device
        self.spec: DisplaySpec = profile.spec()
        panel = profile.panel
        self.samples = profile.sampling
        self.image_samples = min(profile.sampling, 2)
        names = ("bench", profile.name, profile.seed)
        self.ramp = blaze(panel.shape, panel.blaze)
        self.weights = sample_weights(self._padded(), self.samples, panel.blaze, hold=profile.aperture is not None)
        self.crosstalk = profile.crosstalk.weights(self.samples)
        aperture, order = profile.aperture, profile.zero_order
        active = aperture.active_share(self.samples) if aperture else torch.ones(self.samples**2, 1, 1)
        dead = aperture.dead_share(self.samples) if aperture else torch.zeros(self.samples**2, 1, 1)
        grid = (self.samples, self.samples, 1, 1)
        self.modulated = (order.modulated * active).view(grid).to(device)
        self.unmodulated = (order.modulated * dead + order.unmodulated).view(grid)
        self.channels = tuple(
            self._channel(
                Geometry(panel.shape, panel.pitch, wavelength, panel.distance, self.samples, index, names)
            ).to(device)
            for index, wavelength in enumerate(panel.wavelengths)
        )
        geometry = self.channels[0].geometry
        self.drift_gain = profile.drift.phase_gain(geometry)
        self.points = self._pose(geometry).panel_points(
            panel.shape, panel.pitch, profile.sensor.pitch, window=self.spec.region.shape
        )
        self.grid = sampling_grid(self.points, panel.shape).to(device)
        self.response = profile.sensor.response((self.points.shape[0], self.points.shape[1]), geometry)

    def _channel(self, geometry: Geometry) -> ChannelMaps:
        profile = self.profile
        drift = profile.drift.added_tilt(geometry)
        tilt = profile.illumination.tilt
        light = replace(profile.illumination, tilt=(tilt[0] + drift[0], tilt[1] + drift[1]))
        ramp = blaze(geometry.shape, profile.panel.blaze)
        demodulation = torch.polar(torch.ones_like(ramp), -ramp)
        incident = light.field(geometry) * profile.coherent_noise.panel(geometry) * demodulation
        if profile.drift.days:
            incident = incident * profile.drift.dust(geometry, profile.coherent_noise).to(incident.dtype)
        plane = profile.coherent_noise.plane(geometry)
        turning = 1 - profile.coherent_noise.plane_distance if plane is not None else 1.0
        padded, pupil, way = self._padded(), profile.panel.pupil, profile.propagation
        transfer = way.transfer(geometry, padded, pupil, (0.0, turning))
        last = None if plane is None else way.transfer(geometry, padded, pupil, (turning, 1.0))
        if any(profile.eye.focus):
            fy, fx = frequencies(padded, geometry.pitch)
            phase = refocus(profile.eye.focus, fy, fx, geometry.wavelength, geometry.distance)
            eye = torch.polar(torch.ones_like(phase), phase).to(transfer.dtype)
            transfer, last = (transfer * eye, None) if last is None else (transfer, last * eye)
        return ChannelMaps(
            geometry=geometry,
            added=self.ramp + profile.lens.phase(geometry) if any(profile.lens.move) else self.ramp,
            lut_gain=profile.lut.gain_map(geometry),
            amplitude=incident.abs(),
            angle=incident.angle(),
            path=OpticalPath(
                shape=geometry.shape,
                rows=self.weights[0],
                columns=self.weights[1],
                still=by_columns(panel_spectrum(self.unmodulated * incident, *self.weights)),
                transfer=by_columns(transfer),
                dust=None if plane is None else Dust.of(plane.to(transfer.dtype)),
                last=None if last is None else by_columns(last),
                finer=self.image_samples,
            ),
            laser_power=profile.drift.laser_power(geometry) * light.power,
        )

    def _padded(self) -> tuple[int, int]:
        """One size for all channels: that of the longest wavelength, whose light spreads furthest."""
        panel = self.profile.panel
        return padded_shape(panel.shape, panel.pitch, max(panel.wavelengths), panel.distance, panel.pupil, None)

    def _pose(self, geometry: Geometry) -> Relay:
        moved = self.profile.drift.added_shift(geometry)
        shift = self.profile.relay.shift
        return replace(self.profile.relay, shift=(shift[0] + moved[0], shift[1] + moved[1]))

    def modulated_field(self, phase: Tensor, channel: int, flicker: float = 1.0) -> Tensor:
        """Field ``(samples, samples, H, W)`` of the sub-samples' light that follows ``phase`` ``(H, W)`` [rad].

        The carrier is off. The light that follows no phase is in ``ChannelMaps.path``.
        """
        profile, maps = self.profile, self.channels[channel]
        level = straight_through_level(phase + maps.added, profile.panel.bits)
        shown = profile.lut.phase(level, profile.panel.bits, maps.lut_gain * (flicker * self.drift_gain), channel)
        fine = profile.crosstalk.apply(shown, self.crosstalk).view(self.samples, self.samples, *shown.shape)
        return phasor(self.modulated * maps.amplitude, fine + maps.angle)

    def intensity(self, phase: Tensor, channel: int, flicker: float = 1.0) -> Tensor:
        """Noise-free intensity at the image plane, ``image_samples`` a pixel; differentiable in ``phase`` ``(H, W)``.

        Unit: the mean incident intensity on the panel.
        """
        maps = self.channels[channel]
        return squared_modulus(maps.path.image(self.modulated_field(phase, channel, flicker))) * maps.laser_power

    def integrated(self, phase: Tensor, channel: int, flicker: float = 1.0) -> Tensor:
        """Intensity as in ``intensity``, averaged over the area of a sensor pixel."""
        profile = self.profile
        sensor_pixel = profile.sensor.pitch / (profile.relay.magnification * profile.panel.pitch)
        return box_filter(self.intensity(phase, channel, flicker), self.image_samples * sensor_pixel)

    def image(self, phase: Tensor) -> Tensor:
        """``integrated`` of every channel at the panel's pixels, ``(C, H, W)``; differentiable."""
        images = [self.integrated(phase[channel], channel) for channel in range(phase.shape[0])]
        return torch.stack(images)[:, :: self.image_samples, :: self.image_samples]

    def session(self, *names: object, exposure: Sequence[float]) -> BenchSession:
        """A display whose noise depends on ``names`` and the frame number; exposure: electrons a unit of light."""
        return BenchSession(self, names, tuple(exposure))

    def photograph(self, phase: Tensor, exposure: Sequence[float], draw: torch.Generator) -> Capture:
        """One colour-sequential capture of ``phase`` ``(C, H, W)`` [rad]."""
        sensor, frames = self.profile.sensor, []
        phase = phase.to(self.device)
        for channel in range(phase.shape[0]):
            light = self.integrated(phase[channel], channel, self.profile.flicker.gain(draw))
            light = sample(light, self.grid, self.image_samples).cpu()
            frames.append(sensor.expose(light, exposure[channel], self.response, draw))
        gain = tuple(electrons * sensor.counts_per_electron for electrons in exposure)
        return Capture(torch.stack(frames), sensor.dark, sensor.white, gain[: len(frames)])


@dataclass
class BenchSession:
    """The bench under named noise: the same names give the same noise, whatever method is shown."""

    bench: SimulatedBench
    names: tuple[object, ...]
    exposure: tuple[float, ...]
    frames: int = 0

    @property
    def spec(self) -> DisplaySpec:
        """Nominal optics, public."""
        return self.bench.spec

    def announce(self, phases: Sequence[Tensor]) -> None:
        """Nothing: a simulated camera is always ready."""

    @torch.no_grad()
    def capture(self, phase: Tensor) -> Capture:
        """Show ``phase`` ``(C, H, W)`` [rad] and photograph the image plane."""
        profile = self.bench.profile
        draw = generator("bench noise", profile.name, profile.seed, *self.names, self.frames)
        self.frames += 1
        return self.bench.photograph(phase, self.exposure, draw)
