"""The panel: the phase is blazed, wrapped and rounded to gray levels (paper Eq. 6)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, ClassVar

from annotated_types import Interval
from torch import Tensor

from ....optics.phase import TAU, gray_level, wrap
from ...api import DisplaySpec, Region
from ..stage import Effect, Stage

if TYPE_CHECKING:
    from ..profile import Profile


@dataclass(frozen=True)
class Panel(Stage):
    """The nominal, public part of a profile.

    shape (rows, columns) and distance [m] belong together: on a smaller panel the distance shrinks with the rows.
    pitch [m]; wavelengths [m] of red, green, blue, or a single one; bits; pupil: diameter of the iris as a fraction of
    the band (null: none); blaze: (vertical, horizontal) cycles per pixel that the display adds and re-centres;
    region: side of the scored window as a fraction of the panel's.
    """

    title: ClassVar[str] = "panel"
    model: ClassVar[str] = "a blaze is added, the phase wrapped to [0, 2 pi) and rounded to 2^bits levels (paper Eq. 6)"

    shape: tuple[int, int]
    pitch: Annotated[float, Interval(gt=0, lt=1e-3)]
    wavelengths: tuple[float] | tuple[float, float, float]
    distance: Annotated[float, Interval(gt=0, lt=10)]
    bits: Annotated[int, Interval(ge=1, le=16)]
    pupil: Annotated[float, Interval(gt=0, le=1)] | None = None
    blaze: tuple[float, float] = (0.0, 0.0)
    region: Annotated[float, Interval(gt=0.1, le=1)] = 1.0

    def spec(self, name: str) -> DisplaySpec:
        """The nominal optics of a display of that name."""
        height, width = (max(1, round(self.region * size)) for size in self.shape)
        return DisplaySpec(
            name=name,
            shape=self.shape,
            pitch=self.pitch,
            wavelengths=self.wavelengths,
            distance=self.distance,
            bits=self.bits,
            pupil=self.pupil,
            region=Region((self.shape[0] - height) // 2, (self.shape[1] - width) // 2, height, width),
            blaze=self.blaze,
        )

    def effects(self, profile: Profile) -> Iterator[Effect]:
        """Gray levels and blaze."""
        yield Effect("quantisation", f"phase in steps of 2 pi / {2**self.bits}")
        if any(self.blaze):
            cycles = " and ".join(f"{value:g}" for value in self.blaze)
            yield Effect("blaze", f"a carrier of {cycles} cycles a pixel, added before the look-up table")


def straight_through_level(phase: Tensor, bits: int) -> Tensor:
    """Gray level 0 .. 2^bits - 1 of a phase [rad], as a float; its gradient is that of the unrounded level."""
    level = gray_level(phase.detach(), bits)
    if not phase.requires_grad:
        return level
    smooth = wrap(phase) * (2**bits / TAU)
    return smooth + (level - smooth).detach()
