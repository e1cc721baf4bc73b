"""The simulated bench, one stage a file, in the order light meets them."""

from .aperture import PixelAperture
from .coherent_noise import CoherentNoise
from .crosstalk import Crosstalk
from .drift import Drift
from .eye import Eye
from .flicker import Flicker
from .geometry import Geometry
from .illumination import Illumination
from .lens import AddedLens
from .lut import LookUpTable
from .propagation import Propagation
from .relay import Relay
from .sensor import Sensor
from .zero_order import ZeroOrder

__all__ = [
    "AddedLens",
    "CoherentNoise",
    "Crosstalk",
    "Drift",
    "Eye",
    "Flicker",
    "Geometry",
    "Illumination",
    "LookUpTable",
    "PixelAperture",
    "Propagation",
    "Relay",
    "Sensor",
    "ZeroOrder",
]
