"""The panel: the phase is blazed, wrapped and rounded to gray levels (paper Eq. 6)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, ClassVar

from annotated_types import Interval, Len
from torch import Tensor

from ....core.schema import Check, Metres
from ....optics.phase import TAU, gray_level, wrap
from ...api import DisplaySpec, Plane, Region
from ..stage import Effect, Stage
from .spectrum import Width, gaussian_line

if TYPE_CHECKING:
    from ..profile import Profile


Wavelength = Annotated[float, Metres(200e-9, 2000e-9)]
TOLD_LINES = 7  # by which methods are told of a line
SMALLEST_SPAN, LARGEST_SPAN = 20.0, 170.0  # of a table of levels [percent]: no panel has less stroke or more
TURNS = {"radians": TAU, "degrees": 360.0, "turns": 1.0}


class OneOrThree(Check):
    """Of wavelengths, since pictures are gray or of three colours, red first."""

    def fault(self, value: Sequence[float]) -> str:
        """See ``Check``."""
        if len(value) in (1, 3):
            falling = sorted(value, reverse=True)
            return "" if list(value) == falling else f"red comes first, then green and blue: {falling}"
        return f"{len(value)} wavelengths; a display has three, for red, green and blue, or one, for gray pictures"


@dataclass(frozen=True)
class Panel(Stage):
    """The nominal, public part of a profile.

    shape: rows and columns [px]; pitch: from pixel to pixel [m]; wavelengths: of red, green and blue, or a single one
    [m]; distance: from the panel, or its image behind a relay, to the image plane, of a Fourier plane the focal length
    [m], which shrinks with the rows on a smaller panel; bits: gray levels are 2^bits, and 2^bits levels are a full turn
    [bits]; pupil: diameter of the iris, or longer side of the panel for a Fourier plane [share of the image's band],
    null for none; blaze: carrier that the display adds and re-centres, vertical and horizontal [cycles/px]; region:
    side of the scored window [share of the panel's]; levels: phase of each level by the maker's table, which methods
    are told [percent of the largest, ``(L - 1) / L 2 pi``]; none for equal steps; frames: the most that the panel shows
    in one exposure of the camera [count]; linewidth: full width at half maximum of each wavelength by the source's data
    sheet, which methods are told [m]; none for single lines; plane: fresnel for free space between panel and image,
    fourier for a lens that is its focal length away from both; region_offset: of the scored window from the middle of
    the picture, which has the zero order of a Fourier plane, down and right [share of the panel's sides].
    """

    title: ClassVar[str] = "panel"
    model: ClassVar[str] = "a blaze is added, the phase wrapped to [0, 2 pi) and rounded to 2^bits levels (paper Eq. 6)"

    shape: tuple[int, int]
    pitch: Annotated[float, Metres(0.5e-6, 200e-6)]
    wavelengths: Annotated[tuple[Wavelength, ...], OneOrThree()]
    distance: Annotated[float, Metres(0.1e-3, 10)]
    bits: Annotated[int, Interval(ge=1, le=16)]
    pupil: Annotated[float, Interval(gt=0, le=1)] | None = None
    blaze: tuple[float, float] = (0.0, 0.0)
    region: Annotated[float, Interval(gt=0.1, le=1)] = 1.0
    levels: Annotated[tuple[float, ...], Len(0, 1024)] = ()
    frames: Annotated[int, Interval(ge=1, le=256)] = 1
    linewidth: Annotated[tuple[Width, ...], Len(0, 3)] = ()
    plane: Plane = "fresnel"
    region_offset: tuple[float, float] = (0.0, 0.0)

    @property
    def window(self) -> tuple[int, int]:
        """Rows and columns that are scored."""
        height, width = (max(1, round(self.region * size)) for size in self.shape)
        return height, width

    @property
    def offset(self) -> tuple[int, int]:
        """``region_offset``, down and right [px]."""
        places = zip(self.region_offset, self.shape, self.window, strict=True)
        down, right = (sorted((-((n - w) // 2), round(share * n), (n - w) // 2))[1] for share, n, w in places)
        return down, right

    def spec(self, name: str) -> DisplaySpec:
        """The nominal optics of a display of that name."""
        largest = TAU * (1 - 2.0**-self.bits)
        levels = tuple(value / 100 * largest for value in self.levels)
        (height, width), (down, right) = self.window, self.offset
        return DisplaySpec(
            name=name,
            shape=self.shape,
            pitch=self.pitch,
            wavelengths=self.wavelengths,
            distance=self.distance,
            bits=self.bits,
            pupil=self.pupil,
            region=Region((self.shape[0] - height) // 2 + down, (self.shape[1] - width) // 2 + right, height, width),
            blaze=self.blaze,
            levels=(levels,) * len(self.wavelengths) if levels else (),
            frames=self.frames,
            spectrum=tuple(tuple(gaussian_line(width, TOLD_LINES)) for width in self.linewidth),
            plane=self.plane,
        )

    def faults(self) -> Iterator[tuple[str, str]]:
        """Keys whose values do not go together, and why."""
        if fault := self.fault_of(self.levels):
            yield "levels", fault
        widths, colours = len(self.linewidth), len(self.wavelengths)
        if widths not in (0, colours):
            yield "linewidth", f"there are {widths} widths; the panel has {colours} wavelengths"
        if max(map(abs, self.region_offset)) > (1 - self.region) / 2:
            yield "region_offset", f"the region is beyond the picture; up to {(1 - self.region) / 2:.4g} to each side"
        if max(map(abs, self.blaze)) > 0.5:
            yield "blaze", "no panel shows more than 0.5 cycles a pixel, a period of two pixels"
        if self.plane == "fourier" and any(self.blaze):
            yield "blaze", "the picture of a Fourier plane is placed beside the zero order by region_offset, not blaze"

    def fault_of(self, table: Sequence[float]) -> str:
        """What is wrong with a table of levels, its length or its unit; empty for nothing, and for no table."""
        count = 2**self.bits
        if len(table) not in (0, count):
            return f"the table has {len(table)} entries; a panel of {self.bits} bits has {count}"
        span = max(table) - min(table) if table else 100.0
        if SMALLEST_SPAN <= span <= LARGEST_SPAN:
            return ""
        factors = {unit: 100 / (turn * (1 - 1 / count)) for unit, turn in TURNS.items()}
        meant = (unit for unit in factors if SMALLEST_SPAN <= factors[unit] * span <= LARGEST_SPAN)
        remedy = next((f"; of a table in {unit} each entry times {factors[unit]:.4g}" for unit in meant), "")
        return (
            f"the table spans {span:.4g} percent of the largest phase, which is {1 - 1 / count:.4g} turns; expected "
            f"{SMALLEST_SPAN:g} to {LARGEST_SPAN:g}{remedy}"
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
