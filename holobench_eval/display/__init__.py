"""Displays: what a method may touch, and the simulated bench."""

from .api import Capture, Display, DisplaySpec, Region
from .calibrated import CalibratedBench, MeteredDisplay, RectifiedCapture, open_bench
from .simulated.profile import Profile, load_profile

__all__ = [
    "CalibratedBench",
    "Capture",
    "Display",
    "DisplaySpec",
    "MeteredDisplay",
    "Profile",
    "RectifiedCapture",
    "Region",
    "load_profile",
    "open_bench",
]
