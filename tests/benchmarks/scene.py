"""The panel, distance and picture that propagations and gradient steps are timed with."""

from dataclasses import dataclass, replace
from functools import cached_property

import torch
from torch import Tensor

from holobench_eval.display import DisplaySpec, Region
from holobench_eval.optics import AngularSpectrum

THREADS = 2
PITCH, WAVELENGTH = 6.4e-6, 517e-9
SHRINK = 8


@dataclass(frozen=True)
class Scene:
    """A panel without an iris, (rows, columns), and the distance of its image plane [m].

    Phases are random, so that light fills the band, the hardest case for a propagation. target: even, in the middle.
    """

    panel: tuple[int, int]
    distance: float

    @property
    def name(self):
        return f"{self.panel[0]}x{self.panel[1]}, {1e3 * self.distance:g} mm"

    def shrunk(self):
        """A small scene in which light spreads as far, relative to the panel."""
        rows, columns = self.panel
        return replace(self, panel=(rows // SHRINK, columns // SHRINK), distance=self.distance / SHRINK)

    @property
    def spec(self):
        rows, columns = self.panel
        region = Region(rows // 12, columns // 12, rows * 5 // 6, columns * 5 // 6)
        return DisplaySpec("benchmark", self.panel, PITCH, (WAVELENGTH,), self.distance, 8, None, region)

    @cached_property
    def phase(self):
        """``(1, H, W)`` [rad]."""
        return self._random(*self.panel) * 6.283

    @cached_property
    def target(self):
        """Linear light ``(1, h, w)``."""
        return self._random(*self.spec.region.shape)

    def _random(self, *shape):
        return torch.rand(1, *shape, generator=torch.Generator().manual_seed(2020))

    def error(self, field: Tensor) -> float:
        """Relative rms error of the field ``(H, W)`` at the image plane, a constant factor aside."""
        exact = self.reference
        field = field.reshape(exact.shape).to(exact.dtype)
        field = field * ((field.conj() * exact).sum() / (field.abs() ** 2).sum())
        return float((field - exact).norm() / exact.norm())

    @cached_property
    def reference(self) -> Tensor:
        """The exact field; it takes seconds and gigabytes, once."""
        model = AngularSpectrum(self.panel, PITCH, WAVELENGTH, self.distance, padding="reference")
        return model.forward(torch.polar(torch.ones_like(self.phase[0]), self.phase[0]).to(torch.complex128))
