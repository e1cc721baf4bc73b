"""What may change on a bench between its calibration and the day on which it is used, one kind of change at a time.

Each kind changes the parameters of a profile, names the stages that these belong to, and changes no other. Figures that
are marked "assumed" have no published source; lengths are those of the full panel and scale with it.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import replace

from ....core.errors import UserError, suggest
from ..profile import Profile
from ..stages import AddedLens, Eye
from . import camera, draws, vision
from .kind import Kind, Value, added, within

USUAL_BITS = 8  # of the panels that a bit-depth sweep starts from
GREEN = 517e-9  # wavelength [m] that a drift of the lasers is given at
PUPIL = 0.5  # diameter of an eye's pupil, of the iris'; assumed
PLACES = "places from '-1' to '1' radii of the iris"
CLEARING, OPERATING, HALLER = 373.0, 308.0, 0.2
"""Of the liquid crystal: clearing point and panel temperature [K], assumed for a usual mixture, and the exponent of
Haller's law, birefringence ~ (1 - T / T_clearing)^0.2 (Haller, Progress in Solid State Chemistry 10, 103, 1975)."""


_distance = added("propagation", "distance_error", lambda percent: percent / 100)


def _temperature(profile: Profile, kelvin: float) -> Profile:
    stroke = ((CLEARING - OPERATING - kelvin) / (CLEARING - OPERATING)) ** HALLER
    red, green, blue = (gain * stroke for gain in profile.lut.gain)
    return within(profile, "lut", gain=(red, green, blue))


def _bits(profile: Profile, bits: float) -> Profile:
    if profile.panel.bits != USUAL_BITS or profile.lut.table:
        raise UserError(
            f"'{profile.name}' is no panel of {USUAL_BITS} bits with a smooth look-up table, of which to take some"
        )
    if bits != int(bits):
        raise UserError(f"a panel has a whole number of bits, got {bits:g}")
    return within(profile, "panel", bits=int(bits))


def _defocus(profile: Profile, waves: float) -> Profile:
    before = profile.propagation.aberration
    return within(profile, "propagation", aberration={**before, "defocus": before.get("defocus", 0.0) + waves})


def _obstruction(profile: Profile, radius: float) -> Profile:
    return within(profile, "propagation", obstruction=max(profile.propagation.obstruction, radius))


def _refocus(profile: Profile, millimetres: float) -> Profile:
    moved = millimetres * 1e-3 / profile.panel.distance
    return replace(_distance(profile, 100 * moved), lens=AddedLens((moved, moved, 0.0)))


def _corrected_eye(profile: Profile, text: str) -> Profile:
    moved = vision.relative(profile, text)
    return replace(profile, eye=Eye(moved), lens=AddedLens(moved))


def _eye_pupil(profile: Profile, place: str) -> Profile:
    band = profile.panel.pupil or 1.0
    return replace(profile, eye=Eye(pupil=PUPIL * band, decentre=(0.0, float(place) * band)))


def _place(text: str) -> str:
    """A place of the pupil in one form. UserError for one where no pupil is."""
    try:
        place = float(text)
    except ValueError:
        place = math.nan
    if not abs(place) <= 1:
        raise UserError(f"eye_pupil '{text}': expected {PLACES}")
    return f"{place:g}"


KINDS: Mapping[str, Kind] = {
    "camera_shift_x": Kind(
        "camera moved sideways", "mm", camera.STAGES,
        lambda profile, right: camera.moved(profile, 0.0, right), camera.MODEL, low=-40, high=40, moves=True,
    ),
    "camera_shift_y": Kind(
        "camera moved up or down", "mm", camera.STAGES,
        lambda profile, up: camera.moved(profile, -up, 0.0), camera.MODEL, low=-40, high=40, moves=True,
    ),
    "drift": Kind(
        "drift since calibration", "days", ("drift",), added("drift", "days"),
        "seeded walks of laser power, tilt of the beam, stroke of the panel and pose at the profile's daily rates, and "
        "dust that settles at the rate at which the profile's came in a year (assumed)",
        low=0, high=3650, moves=True,
    ),
    "sensor": Kind(
        "another camera", "", ("sensor",), camera.swapped, camera.SENSOR_MODEL,
        nominal=None, moves=True, names=" or ".join(camera.SENSORS),
    ),
    "distance": Kind(
        "error of the propagation distance", "%", ("propagation",), _distance,
        "added to the profile's error", low=-20, high=20,
    ),
    "wavelength": Kind(
        "drift of the lasers' wavelength", "nm", ("propagation",),
        added("propagation", "wavelength_error", lambda nanometres: nanometres * 1e-9 / GREEN),
        "at 517 nm, the other lasers by the same share; added to the profile's error", low=-20, high=20,
    ),
    "defocus": Kind(
        "defocus", "waves rms", ("propagation",), _defocus,
        "Zernike defocus at 517 nm over the iris, added to the profile's", low=-10, high=10,
    ),
    "laser_power": Kind(
        "laser power", "of the nominal", ("illumination",),
        lambda profile, factor: within(profile, "illumination", power=profile.illumination.power * factor),
        "the exposure stays, so that less light is noisier and more may saturate", nominal=1.0, low=0.01, high=20,
    ),
    "temperature": Kind(
        "panel temperature above that of calibration", "K", ("lut",), _temperature,
        "the stroke follows the birefringence by Haller's law, clearing point 100 C, panel at 35 C (assumed)",
        low=-30, high=50,
    ),
    "obstruction": Kind(
        "disc in the middle of the pupil", "of its radius", ("propagation",), _obstruction,
        "opaque, with the soft edge of the iris", low=0, high=0.95,
    ),
    "bits": Kind(
        "bit depth of the panel", "bits", ("panel",), _bits,
        "the same look-up table at fewer levels", nominal=float(USUAL_BITS), low=1, high=USUAL_BITS,
    ),
    "sibling": Kind(
        "another panel of the same kind", "", ("seed",),
        lambda profile, index: replace(profile, seed=profile.seed + int(index)),
        "same profile, every random pattern drawn anew", nominal=None, moves=True, counted=True,
    ),
    "ambient": Kind(
        "ambient light", "of a white pixel", ("sensor",), added("sensor", "ambient"),
        "even over the sensor, and not in the dark frame", low=0, high=10,
    ),
    "refocus": Kind(
        "image moved by a lens phase, camera at its new place", "mm", ("lens", "propagation"), _refocus,
        "paper 7.1: a lens added to the same hologram; on a smaller panel the way shrinks with the distance. What it "
        "loses: the lens tilts light towards the panel's edge, where the iris cuts another part of its band, and adds "
        "wraps, which a panel with crosstalk blurs",
        low=-50, high=50, moves=True,
    ),
    "other_plane": Kind(
        "camera out of the image plane", "mm", ("propagation",),
        lambda profile, millimetres: _distance(profile, 100 * millimetres * 1e-3 / profile.panel.distance),
        "as refocus, without the lens", low=-50, high=50,
    ),
    "eye": Kind(
        "eye that needs glasses", "", ("eye",),
        lambda profile, text: replace(profile, eye=Eye(vision.relative(profile, text))),
        f"relaxed, behind an eyepiece of {1e3 * vision.EYEPIECE:g} mm (assumed); sphere / cylinder x axis in dioptres "
        "and degrees",
        nominal=None, read=vision.one_form, names=vision.NAMES,
    ),
    "corrected_eye": Kind(
        "the same eye, corrected by the hologram", "", ("eye", "lens"), _corrected_eye,
        "paper 4.2: a phase of the prescription's sphere and cylinder added to the same hologram",
        nominal=None, read=vision.one_form, names=vision.NAMES, moves=True,
    ),
    "known_eye": Kind(
        "the same eye, known to the methods", "", ("eye",),
        lambda profile, text: replace(profile, eye=Eye(vision.relative(profile, text), known=True)),
        "the eye is part of the nominal optics that holograms are computed for",
        nominal=None, read=vision.one_form, names=vision.NAMES,
    ),
    "eye_pupil": Kind(
        "place of the eye's pupil, sideways from the axis, in radii of the iris", "", ("eye",), _eye_pupil,
        f"a pupil of {PUPIL:g} of the iris' diameter (assumed) in an image of the iris, which is the eyebox; the "
        "camera stays where it was registered",
        nominal=None, read=_place, names=PLACES,
    ),
    "draw": Kind(
        "random draw of the bench's parameters", "", draws.STAGES,
        lambda profile, index: draws.drawn(profile, int(index)), draws.MODEL, nominal=None, moves=True, counted=True,
    ),
}  # fmt: skip
"""Every kind of condition by its name in a config."""


def checked(kind: str, value: Value) -> Value:
    """A value as its kind has it: a number within its range, a name as text. UserError for anything else."""
    if kind not in KINDS:
        raise UserError(f"unknown condition '{kind}'; {suggest(kind, KINDS)}")
    limits = KINDS[kind]
    if limits.counted:
        text = f"{value:g}" if isinstance(value, float) else str(value)
        if not re.fullmatch(r"[1-9]\d{0,8}", text):
            raise UserError(f"{kind} is named by a whole number from 1, got {value!r}")
        return text
    if not limits.numeric:
        return limits.read(str(value))
    if not isinstance(value, int | float) or isinstance(value, bool) or not limits.low <= value <= limits.high:
        unit = f" [{limits.unit}]" if limits.unit else ""
        raise UserError(f"{kind} is a number{unit} from {limits.low:g} to {limits.high:g}, got {value!r}")
    return float(value)


def altered(profile: Profile, kind: str, value: Value) -> Profile:
    """The profile, not scaled to a panel yet, after a change; the same object for a kind's nominal value.

    UserError for a change that has no meaning on the profile.
    """
    if KINDS[kind].numeric and value == KINDS[kind].nominal:
        return profile
    changed = KINDS[kind].apply(profile, value)
    drawn = [((), "it draws other patterns, and the profile's maps stay")] if changed.seed != profile.seed else []
    if profile.network.method:
        raise UserError(f"{kind} does not suit '{profile.name}': it is a network, which nothing changes")
    for _, fault in (*changed.plane_faults(), *(drawn if profile.held else []), *changed.map_faults()):
        raise UserError(f"{kind} does not suit '{profile.name}': {fault}")
    return changed
