"""The effects that a display profile has, by name, so that it can be said which of them a model of it lacks."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from .profile import Profile

FRINGES_AT = 532e-9
"""Wavelength [m] at which ``Illumination.fringe_cycles`` is told, and the finest of its systems in units of it."""
FINEST_FRINGES = 1.4
IMAGE_SAMPLES = 2
"""A pixel and axis, at most, with which a bench has its image; a smaller sensor pixel averages nothing."""


@dataclass(frozen=True)
class Effect:
    """One way in which a bench is not ideal. name: what a model's form is a set of; text: it, with its figures."""

    name: str
    text: str


def effects(profile: Profile) -> list[Effect]:
    """Every effect of a profile, in the order in which light meets them; those that are switched off are left out."""
    return [*_panel(profile), *_beam(profile), *_way(profile), *_camera(profile)]


def _panel(profile: Profile) -> Iterator[Effect]:
    panel, lut, aperture = profile.panel, profile.lut, profile.aperture
    yield Effect("quantisation", f"phase in steps of 2 pi / {2**panel.bits}")
    if any(panel.blaze):
        cycles = " and ".join(f"{value:g}" for value in panel.blaze)
        yield Effect("blaze", f"a carrier of {cycles} cycles a pixel, added before the look-up table")
    if lut.table:
        yield Effect("look_up_table", f"a measured look-up table of {len(lut.table)} levels")
    elif set(lut.gamma + lut.gain) != {1.0}:
        powers, gains = ("/".join(f"{value:g}" for value in given) for given in (lut.gamma, lut.gain))
        yield Effect("look_up_table", f"look-up table, exponent {powers}, stroke {gains} of a turn (R/G/B)")
    if lut.variation:
        yield Effect("gain_map", f"stroke uneven over the panel, {_percent(lut.variation)} rms, smooth")
    if profile.crosstalk.width:
        yield Effect("crosstalk", f"crosstalk of {profile.crosstalk.width:g} px")
    if profile.sampling > 1:
        grid = f"{profile.sampling} x {profile.sampling}"
        yield Effect("sub_pixel_field", f"structure inside a pixel, {grid} samples, each where it is")
    if aperture is not None and aperture.fill < 1:
        dead = f"{_percent(aperture.fill)} active area, the rest reflects an amplitude of {aperture.dead_amplitude:g}"
        yield Effect("pixel_aperture", f"pixels of {dead}")
    if profile.flicker.rms:
        yield Effect("flicker", f"flicker, {_percent(profile.flicker.rms)} rms of the stroke from frame to frame")


def _beam(profile: Profile) -> Iterator[Effect]:
    light, dirt = profile.illumination, profile.coherent_noise
    if light.beam_sigma is not None:
        yield Effect("beam", f"Gaussian beam of {light.beam_sigma:g} panel heights")
    if light.fringes:
        finest = light.fringe_cycles * FRINGES_AT / min(profile.panel.wavelengths) * FINEST_FRINGES
        yield Effect("fringes", f"fringes of {_percent(light.fringes)}, up to {finest:.0f} cycles a panel height")
    if light.phase_rms:
        yield Effect("wavefront", f"smooth phase of the beam, {light.phase_rms:g} rad rms")
    if any(light.tilt):
        yield Effect("tilt", f"tilt of the beam, {math.hypot(*light.tilt):.2g} cycles a panel height")
    if dirt.specks or dirt.scratches:
        yield Effect("panel_dust", f"dust at the panel, {dirt.specks} specks and {dirt.scratches} scratches")
    if dirt.roughness:
        size = f"{dirt.roughness:g} rad rms over {dirt.roughness_pixels:g} px"
        yield Effect("roughness", f"rough surface of the panel, {size}")


def _way(profile: Profile) -> Iterator[Effect]:
    way, order, dirt = profile.propagation, profile.zero_order, profile.coherent_noise
    if way.distance_error or way.wavelength_error:
        errors = f"{_percent(way.distance_error)} of the distance, {_percent(way.wavelength_error)} of the wavelength"
        yield Effect("defocus", f"wrong by {errors}")
    for name, waves in way.aberration.items():
        if waves:
            yield Effect(name, f"aberration {name.replace('_', ' ')}, {waves:g} waves rms at 517 nm")
    if order.fraction:
        yield Effect("zero_order", f"{_percent(order.fraction)} of the light unmodulated")
    if dirt.plane_specks:
        place = f"{_percent(dirt.plane_distance)} of the way before the image"
        yield Effect("plane_dust", f"dust on an intermediate plane, {dirt.plane_specks} specks {place}")


def _camera(profile: Profile) -> Iterator[Effect]:
    relay, sensor, drift = profile.relay, profile.sensor, profile.drift
    if relay.rotation or any(relay.shift) or any(relay.perspective) or relay.distortion:
        yield Effect("pose", "pose of the camera, what registration leaves of it and its interpolation")
    size = sensor.pitch / (relay.magnification * profile.panel.pitch)
    if size * min(profile.sampling, IMAGE_SAMPLES) > 1:
        yield Effect("sensor_area", f"sensor pixels that average over {size:.2g} px")
    if sensor.vignetting:
        yield Effect("vignetting", f"vignetting, {_percent(sensor.vignetting)} at the corner")
    if sensor.prnu:
        yield Effect("fixed_pattern", f"fixed pattern of the sensor, {_percent(sensor.prnu)} rms")
    if sensor.nonlinearity:
        yield Effect("sensor_response", f"non-linear sensor, {_percent(sensor.nonlinearity)} less at full scale")
    if sensor.noise:
        yield Effect("noise", f"shot noise of {sensor.full_well:g} electrons, read noise of {sensor.read_noise:g}")
    if drift.days:
        yield Effect("drift", f"drift of {drift.days:g} days")


def _percent(share: float) -> str:
    return f"{100 * share:.3g} %"
