"""What Python shows of results: a line that says what they are, in the place of their numbers."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from ..core.errors import UserError
from ..metrics.catalogue import catalogue

Array = NDArray[np.float32]
TARGET: Final = "target, linear light in [0, 1]"
CAPTURE: Final = "capture, linear light where 1 is a white pixel at full efficiency"
IDEAL: Final = "image of the nominal model, intensity where 1 is the incident light"
PHASE: Final = "phase [rad]"
SEEN: Final = "phase [rad] for a display with faults"
LONGEST = 1000  # numbers that are shown themselves, as NumPy does


class Described(np.ndarray[Any, np.dtype[np.float32]]):
    """An array of NumPy that says what it is; what is computed from it is a plain one.

    what: the quantity, with its unit, also of a view.
    """

    what: str = ""

    def __array_finalize__(self, other: Any) -> None:
        self.what = getattr(other, "what", "") if np.may_share_memory(self, other) else ""

    def __array_wrap__(self, array: Any, context: Any = None, return_scalar: bool = False) -> Any:
        return np.asarray(array)[()]

    def __repr__(self) -> str:
        if self.size <= LONGEST or not self.what:
            return repr(np.asarray(self))
        return f"<{self.what}: {self.shape}, from {self.min():.3g} to {self.max():.3g}>"


def described(array: Array, what: str) -> Array:
    """The array, with what it is."""
    view = array.view(Described)
    view.what = what
    return view


def refuse_swapped(capture: object, target: object) -> None:
    """UserError for arrays of this package in each other's place: they would have another score."""
    if getattr(capture, "what", "") == TARGET and getattr(target, "what", "") in (CAPTURE, IDEAL):
        raise UserError("the capture is a target and the target a capture; expected score(capture, target)")


class Scores(dict[str, float]):
    """Scores by name, which are shown by the leading two and the number of the others."""

    def __repr__(self) -> str:
        units = {column: metric.unit for metric in catalogue() for column in metric.columns}
        first = [f"{name} {self[name]:.4g} {units.get(name, '')}".rstrip() for name in list(self)[:2]]
        more = f" and {len(self) - 2} more" if len(self) > 2 else ""
        return f"<scores: {', '.join(first)}{more}>"
