"""From a capture to the scored region: fiducial grid, registration, bounded rigid refinement."""

from .grid import FiducialGrid, fiducial
from .refine import Refined, refine
from .register import Registration, register
from .warp import Warp

__all__ = ["FiducialGrid", "Refined", "Registration", "Warp", "fiducial", "refine", "register"]
