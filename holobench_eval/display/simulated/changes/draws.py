"""Other benches of the same kind: a profile's parameters drawn within the ranges that are published for them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import torch

from ....core.seeds import generator, seed
from ....optics.phase import TAU
from ..profile import Profile

STAGES = (
    *("seed", "sampling", "lut", "crosstalk", "aperture", "flicker", "illumination", "coherent_noise", "propagation"),
    *("zero_order", "spectrum", "stray_light"),
)
MODEL = (
    "every parameter of the table drawn evenly within its range, and every random pattern anew; pose, camera and what "
    "is public of the panel stay"
)

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
    put: Callable[[Profile, float], Profile]


def _gamma(profile: Profile, value: float) -> Profile:
    return replace(profile, lut=replace(profile.lut, gamma=(value, value, value), table=()))


def _gain(profile: Profile, value: float) -> Profile:
    return replace(profile, lut=replace(profile.lut, gain=(value, value, value)))


def _crosstalk(profile: Profile, value: float) -> Profile:
    return replace(profile, crosstalk=replace(profile.crosstalk, width=value), sampling=max(3, profile.sampling))


def _fill(profile: Profile, value: float) -> Profile:
    if profile.aperture is None:
        return profile
    return replace(profile, aperture=replace(profile.aperture, fill=value))


def _flicker(profile: Profile, value: float) -> Profile:
    return replace(profile, flicker=replace(profile.flicker, rms=value))


def _beam(profile: Profile, value: float) -> Profile:
    return replace(profile, illumination=replace(profile.illumination, beam_sigma=value))


def _fringes(profile: Profile, value: float) -> Profile:
    return replace(profile, illumination=replace(profile.illumination, fringes=value))


def _wavefront(profile: Profile, value: float) -> Profile:
    return replace(profile, illumination=replace(profile.illumination, phase_rms=value))


def _distance(profile: Profile, value: float) -> Profile:
    return replace(profile, propagation=replace(profile.propagation, distance_error=value / 100))


def _astigmatism(profile: Profile, value: float) -> Profile:
    return _aberration(profile, "astigmatism_0", value, 2)


def _coma(profile: Profile, value: float) -> Profile:
    return _aberration(profile, "coma_x", value, 3)


def _aberration(profile: Profile, name: str, value: float, power: int) -> Profile:
    """The ranges are of a wide iris; through a smaller one the same lenses have less, by that power of its radius."""
    waves = value * ((profile.panel.pupil or 1.0) / WIDE) ** power
    way = profile.propagation
    return replace(profile, propagation=replace(way, aberration={**way.aberration, name: waves}))


def _zero_order(profile: Profile, value: float) -> Profile:
    return replace(profile, zero_order=replace(profile.zero_order, fraction=value))


def _zero_phase(profile: Profile, value: float) -> Profile:
    return replace(profile, zero_order=replace(profile.zero_order, phase=value))


def _width(profile: Profile, value: float) -> Profile:
    if not 0 < max(profile.spectrum.width) <= LASER:  # no laser: what is drawn would be another kind of source
        return profile
    width = (value * 1e-9, value * 1e-9, value * 1e-9)
    return replace(profile, spectrum=replace(profile.spectrum, width=width))


def _share(profile: Profile, value: float) -> Profile:
    if not profile.stray_light.share:
        return profile
    return replace(profile, stray_light=replace(profile.stray_light, share=value))


def _reach(profile: Profile, value: float) -> Profile:
    if not profile.stray_light.share:
        return profile
    return replace(profile, stray_light=replace(profile.stray_light, reach=value))


def _specks(profile: Profile, value: float) -> Profile:
    return replace(profile, coherent_noise=replace(profile.coherent_noise, specks=round(value)))


PARAMETERS: Mapping[str, Parameter] = {
    "gamma": Parameter("exponent of the look-up table", "", 1.0, 1.28, "1.03-1.25 for an aged LCoS, assumed", _gamma),
    "gain": Parameter(
        "stroke of the look-up table", "of 2 pi", 0.88, 1.05, "0.9-1.05 for an aged LCoS, assumed", _gain
    ),
    "crosstalk": Parameter("crosstalk", "px", 0.2, 0.5, "0.25 px measured, 0.3-0.5 plausible at 6.4 um", _crosstalk),
    "fill": Parameter("fill factor", "", 0.87, 0.95, "87 % of one 8 um panel, under 95 % usual", _fill),
    "flicker": Parameter("flicker", "of the stroke", 0.0, 0.05, "0-5 % of 2 pi reported", _flicker),
    "beam": Parameter("width of the beam", "panel heights", 0.93, 1.57, "1000-1700 px in use", _beam),
    "fringes": Parameter("fringes", "of the amplitude", 0.0, 0.1, "5-10 % from an uncoated cover glass", _fringes),
    "wavefront": Parameter("phase of the beam", "rad rms", 0.0, 0.4, "assumed, up to lambda / 16", _wavefront),
    "distance": Parameter("error of the distance", "%", -1.0, 1.0, "0.1-1 % when focused by eye", _distance),
    "astigmatism": Parameter("astigmatism", "waves rms", -0.15, 0.15, "up to a few tenths of a wave", _astigmatism),
    "coma": Parameter("coma", "waves rms", -0.15, 0.15, "up to a few tenths of a wave", _coma),
    "zero_order": Parameter("unmodulated light", "of the power", 0.0, 0.35, "20 % usual, 35 % reported", _zero_order),
    "zero_phase": Parameter("phase of the unmodulated light", "rad", -TAU / 2, TAU / 2, "unknown", _zero_phase),
    "specks": Parameter("specks of dust on the panel", "", 0.0, 50.0, "assumed", _specks),
    "linewidth": Parameter("width of the laser line", "nm", 1.0, 5.0, "1-5 nm of laser diodes", _width),
    "stray": Parameter(
        "stray light", "of the light", 0.0, 0.3, "assumed, a contrast of 6:1 in a fine checkerboard", _share
    ),
    "reach": Parameter("reach of the stray light", "panel heights", 0.05, 0.3, "assumed", _reach),
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
