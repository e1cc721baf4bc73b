"""Other benches of the same kind: a profile's parameters drawn within the ranges that are published for them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import torch

from ....core.seeds import generator, seed
from ....optics.phase import TAU
from ..profile import Profile
from .kind import within

STAGES = (
    *("seed", "sampling", "lut", "crosstalk", "aperture", "flicker", "illumination", "coherent_noise", "propagation"),
    *("zero_order", "spectrum", "stray_light"),
)
MODEL = (
    "every parameter of the table drawn evenly within its range, and every random pattern anew; pose, camera and what "
    "is public of the panel stay"
)

Put = Callable[[Profile, float], Profile]
LASER = 5e-9  # m: the widest line of a laser diode
WIDE = 0.8  # of the band: the iris that ranges of aberrations are given for


@dataclass(frozen=True)
class Parameter:
    """A parameter that is drawn evenly between ``low`` and ``high``.

    put: the profile with a value of it; source: where the range comes from.
    """

    words: str
    unit: str
    low: float
    high: float
    source: str
    put: Put


def _of(stage: str, key: str) -> Put:
    """A parameter of a stage as it is drawn."""
    return lambda profile, value: within(profile, stage, **{key: value})


def _gamma(profile: Profile, value: float) -> Profile:
    return within(profile, "lut", gamma=(value, value, value), table=())


def _gain(profile: Profile, value: float) -> Profile:
    return within(profile, "lut", gain=(value, value, value))


def _crosstalk(profile: Profile, value: float) -> Profile:
    return replace(within(profile, "crosstalk", width=value), sampling=max(3, profile.sampling))


def _fill(profile: Profile, value: float) -> Profile:
    return profile if profile.aperture is None else within(profile, "aperture", fill=value)


def _distance(profile: Profile, value: float) -> Profile:
    return within(profile, "propagation", distance_error=value / 100)


def _aberration(name: str, power: int) -> Put:
    """The ranges are of a wide iris; through a smaller one the same lenses have less, by that power of its radius."""

    def put(profile: Profile, value: float) -> Profile:
        waves = value * ((profile.panel.pupil or 1.0) / WIDE) ** power
        return within(profile, "propagation", aberration={**profile.propagation.aberration, name: waves})

    return put


def _width(profile: Profile, value: float) -> Profile:
    if not 0 < max(profile.spectrum.width) <= LASER:  # no laser: what is drawn would be another kind of source
        return profile
    return within(profile, "spectrum", width=(value * 1e-9, value * 1e-9, value * 1e-9))


def _stray(key: str) -> Put:
    """Of a profile that has stray light at all."""
    return lambda profile, value: within(profile, "stray_light", **{key: value} if profile.stray_light.share else {})


def _specks(profile: Profile, value: float) -> Profile:
    return within(profile, "coherent_noise", specks=round(value))


PARAMETERS: Mapping[str, Parameter] = {
    "gamma": Parameter("exponent of the look-up table", "", 1.0, 1.28, "1.03-1.25 for an aged LCoS, assumed", _gamma),
    "gain": Parameter(
        "stroke of the look-up table", "of 2 pi", 0.88, 1.05, "0.9-1.05 for an aged LCoS, assumed", _gain
    ),
    "crosstalk": Parameter("crosstalk", "px", 0.2, 0.5, "0.25 px measured, 0.3-0.5 plausible at 6.4 um", _crosstalk),
    "fill": Parameter("fill factor", "", 0.87, 0.95, "87 % of one 8 um panel, under 95 % usual", _fill),
    "flicker": Parameter("flicker", "of the stroke", 0.0, 0.05, "0-5 % of 2 pi reported", _of("flicker", "rms")),
    "beam": Parameter(
        "width of the beam", "panel heights", 0.93, 1.57, "1000-1700 px in use", _of("illumination", "beam_sigma")
    ),
    "fringes": Parameter(
        "fringes", "of the amplitude", 0.0, 0.1, "5-10 % from an uncoated cover glass", _of("illumination", "fringes")
    ),
    "wavefront": Parameter(
        "phase of the beam", "rad rms", 0.0, 0.4, "assumed, up to lambda / 16", _of("illumination", "phase_rms")
    ),
    "distance": Parameter("error of the distance", "%", -1.0, 1.0, "0.1-1 % when focused by eye", _distance),
    "astigmatism": Parameter(
        "astigmatism", "waves rms", -0.15, 0.15, "up to a few tenths of a wave", _aberration("astigmatism_0", 2)
    ),
    "coma": Parameter("coma", "waves rms", -0.15, 0.15, "up to a few tenths of a wave", _aberration("coma_x", 3)),
    "zero_order": Parameter(
        "unmodulated light", "of the power", 0.0, 0.35, "20 % usual, 35 % reported", _of("zero_order", "fraction")
    ),
    "zero_phase": Parameter(
        "phase of the unmodulated light", "rad", -TAU / 2, TAU / 2, "unknown", _of("zero_order", "phase")
    ),
    "specks": Parameter("specks of dust on the panel", "", 0.0, 50.0, "assumed", _specks),
    "linewidth": Parameter("width of the laser line", "nm", 1.0, 5.0, "1-5 nm of laser diodes", _width),
    "stray": Parameter(
        "stray light", "of the light", 0.0, 0.3, "assumed, a contrast of 6:1 in a fine checkerboard", _stray("share")
    ),
    "reach": Parameter("reach of the stray light", "panel heights", 0.05, 0.3, "assumed", _stray("reach")),
}
"""What is drawn. Ranges without another source are those of the sources that the profiles name."""


def values(profile: Profile, index: int) -> dict[str, float]:
    """The parameters of a draw, by their names in ``PARAMETERS``; they depend on the profile's name and seed."""
    draw = generator("bench draw", profile.name, profile.seed, index)
    shares = torch.rand(len(PARAMETERS), generator=draw, dtype=torch.float64).tolist()
    pairs = zip(PARAMETERS.items(), shares, strict=True)
    return {name: drawn.low + (drawn.high - drawn.low) * share for (name, drawn), share in pairs}


def drawn(profile: Profile, index: int) -> Profile:
    """The bench of a draw: ``values`` in the place of the profile's, and patterns of its own."""
    bench = replace(profile, seed=seed("patterns of a draw", profile.seed, index))
    for name, value in values(profile, index).items():
        bench = PARAMETERS[name].put(bench, value)
    return bench
