"""A conformance kit that any near-field propagator can be put through (``holoeval conformance``).

Each check is there for mistakes that public hologram code makes; docs/propagation.md says which.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal

import torch
from torch import Tensor

from ..core.seeds import generator
from ..optics.angular_spectrum import AngularSpectrum
from ..optics.fresnel import Fresnel
from ..optics.point_source import PointSource
from .propagation_reference import Physics, Setting, difference, direct_sum, gaussian_beam, propagated, white_field
from .propagator import BAND, Make, NotApplicableError, Subject, WrongResultError, adjoint

FINE_PITCH = 3.74e-6
"""That of a recent panel [m]: its steeper light tells an exact model from a paraxial one."""

FAR_BOUND = 0.2
"""Padded to twice the size, a hard band limit (Matsushima & Shimobaba 2009) errs by 0.18 here, and none by 2.2."""

STEP = 0.02
"""Of a phase in the finite difference [rad], in units of a random direction of standard deviation 1."""

ROUND_TRIP = 1e-3


@dataclass(frozen=True)
class Finding:
    """The outcome of one check: ``value`` must not exceed ``bound``, both in ``unit``; ``note``: why there is none."""

    check: str
    verdict: Literal["PASS", "FAIL", "n/a"]
    value: float
    bound: float
    unit: str
    note: str = ""


def _direct_sum(subject: Subject, size: int, waist: float, distance: float) -> float:
    """Relative rms error against the direct sum on points of the inner half of the window."""
    setting, field = Setting((size, size), distance), gaussian_beam((size, size), waist)
    points = torch.randint(size // 4, 3 * size // 4, (2, 64), generator=generator("conformance", "points", size))
    image = subject.propagate(field, setting)
    right = direct_sum(field, points[0], points[1], distance)
    return difference(image[points[0], points[1]], right)


def _white(subject: Subject, shape: tuple[int, int], distance: float) -> float:
    setting, field = Setting(shape, distance, FINE_PITCH), white_field(shape, subject.band)
    return difference(subject.propagate(field, setting), propagated(field, setting, subject.physics))


def _energy(subject: Subject) -> float:
    setting, field = Setting((128, 128), 0.02), gaussian_beam((128, 128), 120e-6)
    return abs(float(subject.propagate(field, setting).norm() / field.norm()) ** 2 - 1)


def _centring(subject: Subject) -> float:
    """Distance [px] of the focus of a converging wave from the middle of the panel."""
    setting = Setting((128, 128), 0.015)
    field = gaussian_beam((128, 128), 150e-6, focus=setting.distance)
    image = subject.propagate(field, setting)
    power, index = image.abs().square(), torch.arange(128, dtype=torch.float64) - 127 / 2
    dy, dx = (float((power.sum(axis) * index).sum() / power.sum()) for axis in (1, 0))
    return math.hypot(dy, dx)


def _wrap_around(subject: Subject, distance: float, tilt: float, start: int) -> float:
    """Share of its energy that a beam leaves in the window, beyond what belongs there, as it leaves it on one side."""
    setting = Setting((96, 96), distance)
    to_the_right = torch.roll(gaussian_beam((96, 96), 60e-6, tilt=(0.0, tilt)), start, 1)
    measured = []
    for field in (to_the_right, to_the_right.T):
        image = subject.propagate(field, setting)
        right = propagated(field, setting, subject.physics)
        measured.append(abs(float((image.norm() ** 2 - right.norm() ** 2) / field.norm() ** 2)))
    return max(measured)


def _round_trip(subject: Subject) -> float:
    there, back = Setting((128, 128), 0.02), Setting((128, 128), -0.02)
    field = gaussian_beam(there.shape, 100e-6)
    return difference(subject.propagate(subject.propagate(field, there), back), field)


def _adjointness(subject: Subject) -> float:
    setting = Setting((48, 80), 0.01)
    u, v = torch.randn(2, *setting.shape, generator=generator("conformance", "fields"), dtype=torch.complex64)
    back = adjoint(subject.model(setting), v, at=u)
    u, v = u.to(back), v.to(back)
    products = torch.vdot(subject.propagate(u, setting).flatten(), v.flatten()), torch.vdot(u.flatten(), back.flatten())
    return float((products[0] - products[1]).abs() / (u.norm() * v.norm()))


def _gradient(subject: Subject) -> float:
    """Relative error of the gradient of ``sum((|P e^(i phi)|^2 - T)^2)`` in the phase, along a direction.

    The direction is a random one and that of the gradient in equal parts: along some random ones the loss hardly
    changes, and rounding would then be taken for an error.
    Against a central difference of fourth order: its step of some hundredths of a radian changes the loss by far more
    than single precision does.
    """
    setting, draw = Setting((40, 56), 0.008), generator("conformance", "gradient")
    phase, random = torch.randn(2, *setting.shape, generator=draw, dtype=torch.float64)
    target = torch.rand(setting.shape, generator=draw, dtype=torch.float64)

    def loss(moved: Tensor) -> float:
        image = subject.propagate(torch.polar(torch.ones_like(moved), moved), setting)
        return float((image.abs().square() - target).square().sum())

    panel = torch.polar(torch.ones_like(phase), phase)
    image = subject.propagate(panel, setting)
    back = adjoint(subject.model(setting), 2 * (image.abs().square() - target) * image, at=panel)
    gradient = 2 * (-1j * panel.conj() * back).real
    direction = random + gradient / gradient.square().mean().sqrt().clamp_min(1e-30)
    slope = float((gradient * direction).sum())
    near, far = (loss(phase + step * direction) - loss(phase - step * direction) for step in (STEP, 2 * STEP))
    measured = (8 * near - far) / (12 * STEP)
    return abs(slope / measured - 1)


CHECKS: tuple[tuple[str, float, str, Callable[[Subject], float]], ...] = (
    ("direct sum, 64 px at 5 mm", 1e-3, "relative rms", lambda s: _direct_sum(s, 64, 70e-6, 5e-3)),
    ("long direct sum, 256 px at 0.2 m", 1e-3, "relative rms", lambda s: _direct_sum(s, 256, 200e-6, 0.2)),
    ("white field, 96x128 px at 4 mm", 5e-3, "relative rms", lambda s: _white(s, (96, 128), 4e-3)),
    ("white field, odd, 65x95 px at 3 mm", 5e-3, "relative rms", lambda s: _white(s, (65, 95), 3e-3)),
    ("white field, far, 64x96 px at 12 mm", FAR_BOUND, "relative rms", lambda s: _white(s, (64, 96), 12e-3)),
    ("energy", 1e-3, "relative", _energy),
    ("centring of a focus", 1e-2, "px", _centring),
    ("wrap-around within the band limit", 1e-3, "share of energy", lambda s: _wrap_around(s, 0.01, 0.317, 24)),
    ("wrap-around beyond the band limit", 1e-3, "share of energy", lambda s: _wrap_around(s, 0.025, 0.35, 0)),
    ("round trip", ROUND_TRIP, "relative rms", _round_trip),
    ("adjointness", 1e-5, "relative", _adjointness),
    ("phase gradient", 1e-3, "relative", _gradient),
)


def check_propagator(make: Make, physics: Physics = "exact", band: float = BAND) -> list[Finding]:
    """Put a propagator through all checks, some seconds.

    Parameters
    ----------
    make
        ``make(shape, pitch, wavelength, distance)`` gives a propagator that keeps the pixel grid: docs/propagation.md.
    physics
        What it claims to compute: "exact" scalar diffraction, or its "paraxial" approximation.
    band
        The share of the band of the pixels that it claims to carry on each axis.
    """
    subject = Subject(make, physics, band)
    return [finding(subject, *check) for check in CHECKS]


def finding(subject: Subject, name: str, bound: float, unit: str, measure: Callable[[Subject], float]) -> Finding:
    """Put a propagator through one of `CHECKS`; whatever goes wrong in it is what is found."""
    try:
        value = measure(subject)
        return Finding(name, "PASS" if value <= bound else "FAIL", value, bound, unit)  # NaN fails
    except NotApplicableError as lacking:
        return Finding(name, "n/a", math.nan, bound, unit, str(lacking))
    except WrongResultError as fault:
        return Finding(name, "FAIL", math.nan, bound, unit, str(fault))
    except (Exception, SystemExit) as error:  # whatever a stranger's code does is a finding of this check
        reason = " ".join(str(error).split())[:200]
        return Finding(name, "FAIL", math.nan, bound, unit, f"it raises {type(error).__name__}: {reason}")


SHIPPED = {
    "AngularSpectrum": Subject(AngularSpectrum),
    "Fresnel": Subject(Fresnel, physics="paraxial"),
    # its kernel fades out where it oscillates almost as fast as the pixels sample it
    "PointSource": Subject(PointSource, band=0.7),
}


def main(subjects: Mapping[str, Subject] = SHIPPED) -> int:
    """Print a table for every propagator, those of the package unless others are given; 1 if any check fails."""
    failures = 0
    for name, subject in subjects.items():
        findings = check_propagator(subject.make, subject.physics, subject.band)
        print(f"{name}\n  claims {subject.physics} scalar diffraction on {subject.band:.0%} of the band of the pixels")
        print(f"  {'check':<37}{'measured':>10}{'bound':>9}  unit")
        for each in findings:
            value = "-" if math.isnan(each.value) else f"{each.value:.1e}"
            print(f"  {each.check:<37}{value:>10}{each.bound:>9.0e}  {each.unit:<16} {each.verdict}")
            if each.note:
                print(textwrap.fill(f"    reason: {each.note}", 100, subsequent_indent=" " * 12))
        count = {verdict: sum(each.verdict == verdict for each in findings) for verdict in ("PASS", "FAIL", "n/a")}
        print(f"  {count['PASS']} passed, {count['FAIL']} failed, {count['n/a']} not applicable\n")
        failures += count["FAIL"]
    return int(failures > 0)
