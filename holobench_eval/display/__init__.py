"""Displays: what a method may touch, and the simulated bench."""

from .contract import Capture, Display, DisplaySpec, Region
from .profile import Profile, load_profile
from .workbench import MeteredBench, Shot, Workbench, open_bench

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
