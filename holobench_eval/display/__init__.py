"""Displays: what a method may touch, and the simulated bench."""

from .api import Capture, Display, DisplaySpec, Region
from .calibrated import MeteredBench, Shot, Workbench, open_bench
from .simulated.profile import Profile, load_profile

__all__ = [
    "Capture",
    "Display",
    "DisplaySpec",
    "MeteredBench",
    "Profile",
    "Region",
    "Shot",
    "Workbench",
    "load_profile",
    "open_bench",
]
