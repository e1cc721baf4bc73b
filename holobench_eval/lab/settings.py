"""How photographs are taken on a live bench (``capture:`` of a bench file)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from annotated_types import Interval, MaxLen, MinLen

from ..core.errors import UserError

LONGEST = 600.0  # seconds
Relative = Annotated[float, Interval(gt=0, le=1)]


@dataclass(frozen=True)
class CaptureSettings:
    """Exposure, averaging, dark frames, bracket and settling of every photograph.

    exposure: seconds, one for each colour channel or one for all, or ``auto``: as long as the test pattern allows;
    average: frames whose mean is taken; dark_frames: frames with the laser off whose mean is taken off; dark: counts
    without light, a level or a file beside the bench file, only where dark_frames is 0; hdr: exposures of a bracket,
    relative to ``exposure``; settle: seconds from showing a hologram to exposing, or ``auto``: measured.
    """

    exposure: Literal["auto"] | float | tuple[float, ...] = "auto"
    average: Annotated[int, Interval(ge=1, le=1000)] = 4
    dark_frames: Annotated[int, Interval(ge=0, le=1000)] = 8
    dark: float | str | None = None
    hdr: Annotated[tuple[Relative, ...], MinLen(1), MaxLen(8)] = (1.0,)
    settle: Literal["auto"] | float = "auto"

    def __post_init__(self) -> None:
        if (self.dark_frames == 0) != (self.dark is not None):
            raise UserError(
                "capture: either dark frames (dark_frames: 8) or, with dark_frames: 0, the counts without light "
                "(dark: 64, or dark: a file)"
            )
        # by hand, since of a union only the first type's fault would be reported
        for seconds in self.exposure if isinstance(self.exposure, tuple) else (self.exposure,):
            if seconds != "auto" and not 0 < seconds <= LONGEST:
                raise UserError(
                    f"capture.exposure should be auto, or above 0 and at most {LONGEST:g} s, got {seconds:g}"
                )
        if self.settle != "auto" and not 0 <= self.settle <= LONGEST:
            raise UserError(f"capture.settle should be auto, or 0 to {LONGEST:g} s, got {self.settle:g}")

    def exposures(self, channels: int) -> tuple[float, ...] | None:
        """Seconds for every channel; None for ``auto``. UserError for another number of channels."""
        if self.exposure == "auto":
            return None
        given = self.exposure if isinstance(self.exposure, tuple) else (self.exposure,) * channels
        if len(given) != channels:
            raise UserError(f"capture.exposure has {len(given)} values, but the panel has {channels} wavelengths")
        return given
