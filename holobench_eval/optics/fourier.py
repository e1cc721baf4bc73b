"""The back focal plane of a lens, in which the light of a panel in the front one is its Fourier transform."""

from __future__ import annotations

import math
from collections.abc import Sequence

import torch
from torch import Tensor

from .angular_spectrum import check_geometry


def picture_pitch(
    shape: tuple[int, int], pitch: float, wavelengths: Sequence[float], focal_length: float, pupil: float = 1.0
) -> float:
    """Pitch [m] of the grid of a Fourier plane that all colours share: ``pupil wavelength f / (N pitch)``.

    N: pixels of the panel's longer side; wavelength: the shortest; pupil: share of the grid's band that the panel
    fills. At 1 the longer side of the grid is a diffraction order, and the field between two pixels is free; at 1/2 the
    pixels hold all of the intensity, on half of that side. Lengths in metres.

    Examples
    --------
    >>> round(picture_pitch((1080, 1920), 8e-6, (532e-9,), 0.25) * 1e6, 2)
    8.66
    """
    return pupil * min(wavelengths) * focal_length / (max(shape) * pitch)


def fourier_matrix(pixels: int, size: int, step: float, positions: Sequence[float] = (0.0,), finer: int = 1) -> Tensor:
    """The Fourier transform along an axis from a panel to a picture, as a matrix (Soummer et al., Opt. Express 15,
    15935, 2007; Jurling & Fienup, J. Opt. Soc. Am. A 31, 1348, 2014).

    A sample ``j`` of the picture is at ``v = (j / finer - size // 2) step`` [cycles/px], a sub-sample at ``x`` pixels
    from the middle of the panel, ``pixels // 2``. Sub-samples are squares, so that their light falls off as a sinc:
    ``sqrt(step) / n sinc(v / n) exp(-2 pi i v x)`` for n of them, which keeps the energy.

    Parameters
    ----------
    pixels, size
        Of the panel and of the picture, along the axis.
    step
        From pixel to pixel of the picture [cycles/px of the panel].
    positions
        Of the sub-samples in a pixel of the panel, from its middle [px].
    finer
        Samples a pixel of the picture, the first in the first pixel's middle.

    Returns
    -------
    Tensor
        ``(finer size, n pixels)``, the first sub-sample of all pixels first; complex128.

    Examples
    --------
    >>> field = torch.randn(8, dtype=torch.complex128)
    >>> there = fourier_matrix(8, 8, 1 / 8) @ field
    >>> by_fft = torch.fft.fftshift(torch.fft.fft(torch.fft.ifftshift(field), norm="ortho"))
    >>> torch.allclose(there, by_fft * torch.sinc(torch.arange(-4, 4) / 8))
    True
    """
    n = len(positions)
    cycles = (torch.arange(finer * size, dtype=torch.float64) / finer - size // 2)[:, None] * step
    places = torch.arange(pixels, dtype=torch.float64) - pixels // 2
    at = (torch.tensor(positions, dtype=torch.float64)[:, None] + places).flatten()
    return torch.polar(math.sqrt(step) / n * torch.sinc(cycles / n).expand(-1, len(at)), -2 * math.pi * cycles * at)


class FourierLens:
    """Propagation from the front to the back focal plane of a lens (Goodman, Introduction to Fourier Optics, 5.2.2).

    The panel has square pixels of full area. The zero order arrives at the pixel ``(H // 2, W // 2)``. There is no
    padding and nothing wraps around: what leaves the grid is lost.

    Parameters
    ----------
    shape
        Rows and columns of the panel and of the picture.
    pitch, wavelength
        Of the panel's pixels and of the light [m].
    focal_length
        Of the lens [m].
    sample
        Pitch of the picture [m]; that of ``picture_pitch`` unless given.
    dtype
        complex64 or complex128.
    device
        Where the fields lie.

    Raises
    ------
    ValueError
        A geometry without a meaning.

    Examples
    --------
    >>> model = FourierLens((64, 64), pitch=8e-6, wavelength=532e-9, focal_length=0.25)
    >>> light = model.forward(torch.ones(64, 64, dtype=torch.complex64)).abs().square()
    >>> float(light[32, 32]), float(light.sum())
    (4096.0, 4096.0)
    """

    def __init__(
        self,
        shape: tuple[int, int],
        pitch: float,
        wavelength: float,
        focal_length: float,
        sample: float | None = None,
        dtype: torch.dtype = torch.complex64,
        device: torch.device | str = "cpu",
    ) -> None:
        check_geometry(shape, pitch, wavelength, None)
        sample = picture_pitch(shape, pitch, (wavelength,), focal_length) if sample is None else sample
        if not (focal_length > 0 and sample > 0):
            raise ValueError(f"focal length and sample must be positive metres, got {focal_length} and {sample}")
        step = sample * pitch / (wavelength * focal_length)
        self.shape, self.dtype = shape, dtype
        self._rows, self._columns = (fourier_matrix(side, side, step).to(device, dtype) for side in shape)
        self._rows_back, self._columns_back = (each.mH.resolve_conj() for each in (self._rows, self._columns))

    def forward(self, field: Tensor) -> Tensor:
        """See ``Propagator``."""
        return self.carried(field)

    def adjoint(self, field: Tensor) -> Tensor:
        """See ``Propagator``."""
        return self.carried(field, back=True)

    def carried(self, field: Tensor, back: bool = False, spent: bool = False) -> Tensor:
        """See ``Propagator``."""
        if tuple(field.shape[-2:]) != self.shape:
            raise ValueError(f"field is {tuple(field.shape[-2:])}, the propagator was made for {self.shape}")
        rows, columns = (self._rows_back, self._columns_back) if back else (self._rows, self._columns)
        return rows @ field.to(self.dtype) @ columns.mT
