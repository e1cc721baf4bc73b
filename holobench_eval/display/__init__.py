"""Displays: what a method may touch, and the simulated bench."""

from .api import Capture, Display, DisplaySpec, RectifiedCapture, Region
from .calibrated import CalibratedBench
from .metered import MeteredDisplay
from .simulated.profile import Profile, load_profile

MeteredBench = MeteredDisplay  # the name that `holoeval new` once used to write

__all__ = [
    "CalibratedBench",
    "Capture",
    "Display",
    "DisplaySpec",
    "MeteredBench",
    "MeteredDisplay",
    "Profile",
    "RectifiedCapture",
    "Region",
    "load_profile",
]
