"""The stages of the simulated bench; ``Profile`` lists them in the order in which light meets them."""

from .aperture import PixelAperture as PixelAperture
from .aperture import ZeroOrder as ZeroOrder
from .coherent_noise import CoherentNoise as CoherentNoise
from .coherent_noise import DustPlane as DustPlane
from .crosstalk import Crosstalk as Crosstalk
from .drift import Drift as Drift
from .illumination import Illumination as Illumination
from .lens import AddedLens as AddedLens
from .lens import Eye as Eye
from .lut import Flicker as Flicker
from .lut import LookUpTable as LookUpTable
from .panel import Panel as Panel
from .propagation import Propagation as Propagation
from .relay import Relay as Relay
from .sensor import Sensor as Sensor
from .spectrum import Spectrum as Spectrum
from .stray_light import StrayLight as StrayLight
