"""Free-space propagation, phase tools and colour: everything that is ideal."""

from .angular_spectrum import AngularSpectrum
from .colour import srgb_decode, srgb_encode
from .convolution import Propagator
from .fourier import FourierLens
from .fresnel import Fresnel
from .phase import blaze, lens, quantise, wrap
from .point_source import PointSource
from .zernike import zernike

__all__ = [
    "AngularSpectrum",
    "FourierLens",
    "Fresnel",
    "PointSource",
    "Propagator",
    "blaze",
    "lens",
    "quantise",
    "srgb_decode",
    "srgb_encode",
    "wrap",
    "zernike",
]
