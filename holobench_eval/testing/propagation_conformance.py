"""A conformance kit that any near-field propagator can be put through (``holoeval conformance``).

What each check catches, among the mistakes that public hologram code makes:

| check | what fails it |
|---|---|
| direct sum | a wrong kernel, a wrong sign, a paraxial model beyond its range |
| long direct sum | a carrier exp(ikz) formed in float32, whose phase is noise at decimetres |
| adjointness | a "backward" that is not the adjoint, so that gradients are wrong |
| energy | a wrong normalisation of the FFT or of the kernel |
| centring | a frequency grid that is half a bin off (``linspace`` for ``fftfreq``), a wrong pair of shifts |
| wrap-around | circular convolution: light that leaves on one side comes back on the other |
| round trip | a transfer function that is not unitary, a lost sign of the distance |
| gradient | an adjoint, autograd or dtype fault in the phase gradient |
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor

from ..core.seeds import generator
from ..optics.angular_spectrum import AngularSpectrum
from ..optics.convolution import Propagator
from ..optics.fresnel import Fresnel
from ..optics.phase import lens
from ..optics.point_source import PointSource, impulse_response

PITCH, WAVELENGTH = 6.4e-6, 517e-9

Make = Callable[[tuple[int, int], float, float, float], Propagator]
"""``make(shape, pitch, wavelength, distance)``, lengths in metres, gives a propagator."""


@dataclass(frozen=True)
class Finding:
    """The outcome of one check: ``value`` must not exceed ``bound``, both in ``unit``."""

    check: str
    value: float
    bound: float
    unit: str

    @property
    def passed(self) -> bool:
        """Whether the propagator conforms; NaN does not."""
        return self.value <= self.bound


def gaussian_beam(shape: tuple[int, int], waist: float, tilt: tuple[float, float] = (0.0, 0.0)) -> Tensor:
    """Field ``exp(-r^2 / waist^2)`` [waist in m], optionally tilted (cycles per pixel); complex128."""
    rows = torch.arange(shape[0], dtype=torch.float64) - (shape[0] - 1) / 2
    columns = torch.arange(shape[1], dtype=torch.float64) - (shape[1] - 1) / 2
    radius = (rows[:, None] ** 2 + columns[None, :] ** 2) * PITCH**2
    carrier = 2 * math.pi * (tilt[0] * rows[:, None] + tilt[1] * columns[None, :])
    return torch.polar(torch.exp(-radius / waist**2), carrier.expand_as(radius).contiguous())


def direct_sum(field: Tensor, rows: Tensor, columns: Tensor, distance: float) -> Tensor:
    """First Rayleigh-Sommerfeld integral as a plain sum over source pixels, at some output pixels; complex128.

    Goodman, section 3.5: the kernel of paper Eq. 3 times the obliquity z / rho, times (1 + i / (k rho)).
    The carrier exp(ikz) is left out.
    """
    height, width = field.shape
    y = (rows[:, None] - torch.arange(height)).double() * PITCH
    x = (columns[:, None] - torch.arange(width)).double() * PITCH
    out = torch.zeros(len(rows), dtype=torch.complex128)
    for point in range(len(rows)):
        dy, dx = y[point][:, None], x[point][None, :]
        rho = torch.sqrt(dy**2 + dx**2 + distance**2)
        kernel = impulse_response(dy, dx, WAVELENGTH, distance) * (distance / rho)
        kernel = kernel * torch.complex(torch.ones_like(rho), WAVELENGTH / (2 * math.pi * rho))
        out[point] = (field * kernel).sum() * PITCH**2
    return out


def _relative(image: Tensor, right: Tensor) -> float:
    return float((image - right).norm() / right.norm())


def _sum_error(make: Make, size: int, waist: float, distance: float) -> float:
    """Relative rms error against the direct sum on points of the inner half of the window."""
    field = gaussian_beam((size, size), waist)
    draw = generator("conformance", "points", size)
    points = torch.randint(size // 4, 3 * size // 4, (2, 64), generator=draw)
    image = make((size, size), PITCH, WAVELENGTH, distance).forward(field.to(torch.complex64))
    right = direct_sum(field, points[0], points[1], distance)
    return _relative(image[points[0], points[1]].to(torch.complex128), right)


def _adjointness(make: Make) -> float:
    model = make((48, 80), PITCH, WAVELENGTH, 0.01)
    draw = generator("conformance", "fields")
    u, v = torch.randn(2, 48, 80, generator=draw, dtype=torch.complex64)
    left = torch.vdot(model.forward(u).flatten().to(torch.complex128), v.flatten().to(torch.complex128))
    right = torch.vdot(u.flatten().to(torch.complex128), model.adjoint(v).flatten().to(torch.complex128))
    return float((left - right).abs() / (u.norm() * v.norm()))


def _energy(make: Make) -> float:
    field = gaussian_beam((128, 128), 120e-6).to(torch.complex64)
    image = make((128, 128), PITCH, WAVELENGTH, 0.02).forward(field)
    return abs(float(image.abs().square().sum() / field.abs().square().sum()) - 1)


def _centring(make: Make) -> float:
    """Distance [px] of the focus of a converging wave from the middle of the panel."""
    size, distance = 128, 0.02
    field = gaussian_beam((size, size), 150e-6) * torch.exp(
        1j * lens((size, size), PITCH, WAVELENGTH, distance, dtype=torch.float64)
    )
    power = make((size, size), PITCH, WAVELENGTH, distance).forward(field.to(torch.complex64)).abs().square().double()
    index = torch.arange(size, dtype=torch.float64) - (size - 1) / 2
    total = power.sum()
    return math.hypot(float((power.sum(1) * index).sum() / total), float((power.sum(0) * index).sum() / total))


def _wrap_around(make: Make) -> float:
    """Share of the energy that is still in the window after a tilted beam has left it on the right."""
    size, distance = 96, 0.03
    field = gaussian_beam((size, size), 60e-6, tilt=(0.0, 0.35)).to(torch.complex64)
    image = make((size, size), PITCH, WAVELENGTH, distance).forward(field)
    return float(image.abs().square().sum() / field.abs().square().sum())


def _round_trip(make: Make) -> float:
    field = gaussian_beam((128, 128), 100e-6).to(torch.complex64)
    there = make((128, 128), PITCH, WAVELENGTH, 0.02).forward(field)
    return _relative(make((128, 128), PITCH, WAVELENGTH, -0.02).forward(there), field)


def phase_gradient(model: Propagator, phase: Tensor, target: Tensor) -> Tensor:
    """Gradient of ``sum((|P e^(i phi)|^2 - T)^2)`` in the phase: ``2 Re(-i e^(-i phi) P*(dL/dI E))``."""
    panel = torch.polar(torch.ones_like(phase), phase)
    field = model.forward(panel)
    slope = 2 * (field.abs().square() - target)
    return 2 * (-1j * panel.conj() * model.adjoint(slope * field)).real


def _gradient(make: Make) -> float:
    """Relative error of the analytic phase gradient along a random direction, against a central difference."""
    shape = (40, 56)
    model = make(shape, PITCH, WAVELENGTH, 0.008)
    draw = generator("conformance", "gradient")
    phase, direction = torch.randn(2, *shape, generator=draw, dtype=torch.float64)
    target = torch.rand(shape, generator=draw, dtype=torch.float64)

    def loss(moved: Tensor) -> Tensor:
        field = model.forward(torch.polar(torch.ones_like(moved), moved))
        return (field.abs().square() - target).square().sum()

    analytic = (phase_gradient(model, phase, target) * direction).sum()
    step = 1e-4
    difference = (loss(phase + step * direction) - loss(phase - step * direction)) / (2 * step)
    return float((analytic - difference).abs() / difference.abs())


def check_propagator(make: Make) -> list[Finding]:
    """All checks; needs a propagator that keeps the pixel grid. About one second."""
    return [
        Finding("direct sum, 64 px at 5 mm", _sum_error(make, 64, 70e-6, 5e-3), 1e-3, "relative rms"),
        Finding("long direct sum, 256 px at 0.2 m", _sum_error(make, 256, 200e-6, 0.2), 1e-3, "relative rms"),
        Finding("adjointness", _adjointness(make), 1e-5, "relative"),
        Finding("energy", _energy(make), 1e-3, "relative"),
        Finding("centring of a focus", _centring(make), 1e-2, "px"),
        Finding("wrap-around", _wrap_around(make), 1e-3, "share of energy"),
        Finding("round trip", _round_trip(make), 1e-3, "relative rms"),
        Finding("phase gradient", _gradient(make), 1e-3, "relative"),
    ]


PROPAGATORS: dict[str, Make] = {"AngularSpectrum": AngularSpectrum, "Fresnel": Fresnel, "PointSource": PointSource}


def main() -> int:
    """Print a table for every propagator of the package; 1 if any check fails."""
    failures = 0
    print(f"{'propagator':<18}{'check':<36}{'value':>10}{'bound':>10}  unit")
    for name, make in PROPAGATORS.items():
        for finding in check_propagator(make):
            failures += not finding.passed
            numbers = f"{finding.value:>10.1e}{finding.bound:>10.0e}  {finding.unit:<16}"
            print(f"{name:<18}{finding.check:<36}{numbers} {'ok' if finding.passed else 'FAIL'}")
    return int(failures > 0)
