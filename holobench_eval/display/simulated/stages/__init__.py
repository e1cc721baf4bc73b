"""The stages of the simulated bench; ``Profile`` lists them in the order in which light meets them."""

from .aperture import PixelAperture, ZeroOrder
from .coherent_noise import CoherentNoise, DustPlane
from .crosstalk import Crosstalk
from .drift import Drift
from .illumination import Illumination
from .lens import AddedLens, Eye
from .lut import Flicker, LookUpTable
from .panel import Panel
from .propagation import Propagation
from .relay import Relay
from .sensor import Sensor
from .spectrum import Spectrum
from .stray_light import StrayLight

__all__ = [
    "AddedLens",
    "CoherentNoise",
    "Crosstalk",
    "Drift",
    "DustPlane",
    "Eye",
    "Flicker",
    "Illumination",
    "LookUpTable",
    "Panel",
    "PixelAperture",
    "Propagation",
    "Relay",
    "Sensor",
    "Spectrum",
    "StrayLight",
    "ZeroOrder",
]
