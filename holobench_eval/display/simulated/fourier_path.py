"""The optical path of a bench whose lens stands between panel and camera."""

from __future__ import annotations

import torch
from torch import Tensor

from ...optics.fourier import fourier_matrix
from ...optics.linear import linear
from .geometry import Geometry
from .stages.crosstalk import sample_positions
from .stages.propagation import Propagation


class FourierPath:
    """From the sub-samples of a panel to a Fourier plane, see ``optics.fourier``, for a line of the source.

    The grid stays where the nominal optics have it, so that another wavelength has a picture of another size. finer:
    samples a pixel and axis of the image; rows ``(n H, samples H)``, columns ``(n W, samples W)``: the transform along
    each axis.
    """

    def __init__(
        self, geometry: Geometry, way: Propagation, finer: int, device: torch.device, dtype: torch.dtype
    ) -> None:
        assert geometry.image_pitch is not None
        wavelength = geometry.wavelength * (1 + way.wavelength_error)
        step = geometry.image_pitch * geometry.pitch / (wavelength * geometry.distance)
        positions = sample_positions(geometry.samples)
        matrices = (fourier_matrix(side, side, step, positions, finer) for side in geometry.shape)
        self.rows, self.columns = (matrix.to(device, dtype) for matrix in matrices)
        self.shape, self.samples = geometry.shape, geometry.samples

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
