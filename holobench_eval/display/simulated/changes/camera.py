"""A camera, or an eye, that has moved, and one that was exchanged (paper 7.2)."""

from __future__ import annotations

from dataclasses import replace

from ....core.errors import UserError, suggest
from ..profile import Profile
from ..stages import Sensor

STAGES = ("propagation", "relay", "sensor")
FAR = 40.0  # mm; the paper's largest shift, for which the figures below are. All are assumed: it describes no optics
PUPIL = 0.25  # decentring of the iris along the shift, relative to its radius
COMA, ASTIGMATISM = 0.05, 0.05  # waves rms; coma lies along the shift, astigmatism grows with its square
PERSPECTIVE = 0.016  # relative change of scale over a panel height: a picture of 0.1 m seen from 0.5 m
REST = 0.02  # shift of the picture that is left after the camera is aimed anew [panel heights]
DARKER = 0.2  # vignetting at the corner, growing with the square of the shift
MODEL = (
    f"assumed, at {FAR:g} mm: iris decentred by {PUPIL:g} of its radius, {COMA:g} waves rms of coma, {ASTIGMATISM:g} "
    f"of astigmatism, perspective of {PERSPECTIVE:g}, {100 * DARKER:.0f} % vignetting; the camera is aimed anew"
)

SENSORS = {
    "canon-t6i": Sensor(pitch=3.72e-6, bits=14, full_well=32000, read_noise=7, prnu=0.005, nonlinearity=0.01),
    "fujifilm-s5-pro": Sensor(pitch=5.4e-6, bits=14, full_well=45000, read_noise=12, prnu=0.01, nonlinearity=0.02),
}
"""Pitch by paper 5.1 and 7.2 (23 mm over 4256 pixels), bits of the raw files; the rest is assumed: larger
pixels hold more, a CCD has more read noise and the response of its amplifier."""
SENSOR_MODEL = "pitch and bits as published; well, noise and response assumed"


def moved(profile: Profile, down: float, right: float) -> Profile:
    """The bench seen by a camera that was moved so far [mm]."""
    down, right = down / FAR, right / FAR
    squared = down * down + right * right
    way, relay, sensor = profile.propagation, profile.relay, profile.sensor
    added = {"coma_y": COMA * down, "coma_x": COMA * right, "astigmatism_0": ASTIGMATISM * (right**2 - down**2)}
    aberration = {name: way.aberration.get(name, 0.0) + added.get(name, 0.0) for name in {**way.aberration, **added}}
    return replace(
        profile,
        propagation=replace(
            way,
            aberration=aberration,
            pupil_shift=(way.pupil_shift[0] + PUPIL * down, way.pupil_shift[1] + PUPIL * right),
        ),
        relay=replace(
            relay,
            shift=(relay.shift[0] + REST * down, relay.shift[1] + REST * right),
            perspective=(relay.perspective[0] + PERSPECTIVE * down, relay.perspective[1] + PERSPECTIVE * right),
        ),
        sensor=replace(sensor, vignetting=min(0.99, sensor.vignetting + DARKER * squared)),
    )


def swapped(profile: Profile, name: str) -> Profile:
    """The bench with another camera; what belongs to the lens and the room stays. UserError for an unknown one."""
    if name not in SENSORS:
        raise UserError(f"unknown camera '{name}'; {suggest(name, SENSORS)}")
    old = profile.sensor
    new = replace(SENSORS[name], dark=old.dark, vignetting=old.vignetting, headroom=old.headroom)
    maps = {key: values for key, values in old.maps.items() if key != "exponent"}  # the response was the old one's
    return replace(profile, sensor=replace(new, ambient=old.ambient, noise=old.noise, maps=maps))
