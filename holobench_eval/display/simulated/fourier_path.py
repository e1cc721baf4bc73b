"""The optical path of a bench whose lens stands between panel and camera."""

from __future__ import annotations

from dataclasses import dataclass, replace

import torch
from torch import Tensor

from ...optics.fourier import fourier_matrix
from ...optics.linear import linear
from .geometry import Geometry
from .stages.crosstalk import sample_positions
from .stages.propagation import Propagation


@dataclass(frozen=True, eq=False)
class FourierPath:
    """From the sub-samples of a panel to a Fourier plane, see ``optics.fourier``.

    shape: of the panel; samples: sub-samples a pixel and axis; rows ``(n H, samples H)``, columns ``(n W, samples W)``:
    the transform of one wavelength along each axis.
    """

    shape: tuple[int, int]
    samples: int
    rows: Tensor
    columns: Tensor

    @classmethod
    def of(cls, geometry: Geometry, way: Propagation, finer: int) -> FourierPath:
        """That of a line of the source; finer: samples a pixel and axis of the image.

        The grid stays where the nominal optics have it, so that another wavelength has a picture of another size.
        """
        assert geometry.image_pitch is not None
        wavelength = geometry.wavelength * (1 + way.wavelength_error)
        step = geometry.image_pitch * geometry.pitch / (wavelength * geometry.distance)
        positions = sample_positions(geometry.samples)
        rows, columns = (fourier_matrix(side, side, step, positions, finer) for side in geometry.shape)
        return cls(geometry.shape, geometry.samples, rows.to(torch.complex64), columns.to(torch.complex64))

    def to(self, device: torch.device) -> FourierPath:
        """The same on a device."""
        return replace(self, rows=self.rows.to(device), columns=self.columns.to(device))

    def forward(self, field: Tensor) -> Tensor:
        """See ``LightPath``."""
        return linear(self._ahead, self.adjoint, field)

    def _ahead(self, field: Tensor) -> Tensor:
        light = field.movedim(1, 2).reshape(self.rows.shape[1], self.columns.shape[1])
        return self.rows @ light @ self.columns.mT

    def adjoint(self, image: Tensor) -> Tensor:
        """The adjoint of ``forward``."""
        n, (height, width) = self.samples, self.shape
        return (self.rows.mH @ image @ self.columns.conj()).view(n, height, n, width).movedim(2, 1).contiguous()
