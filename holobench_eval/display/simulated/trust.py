"""How far a twin can stand for the display that it was learned from, as a lab has measured it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated

from annotated_types import Interval, Len

MOST = 3.0  # dB of flattery, above which a twin does not tell which method that learns is better

Decibels = Annotated[float, Interval(ge=-100, le=100)]
Misfit = Annotated[float, Interval(ge=0, le=100)]


@dataclass(frozen=True)
class Trust:
    """What a twin was tried on: holograms and pictures that it did not learn from. No number changes the display.

    of: the display that it was learned from, null for a profile that is no twin; photographs: that its
    training took [count]; pictures: that it was tried on [count]; gap: how much further its captures are from a
    photograph than a second photograph is, by method [dB]; light: the share of it that they are off by besides noise,
    rms, by colour [1]; place: how far they are out of place along each axis, rms, by colour [px]; flattery: score on
    the twin less score on the display, of holograms that were made through the twin, mean over pictures [dB];
    flattery_error: half of its 95 % interval [dB].
    """

    of: str | None = None
    photographs: Annotated[int, Interval(ge=0)] = 0
    pictures: Annotated[int, Interval(ge=0)] = 0
    gap: Mapping[str, Decibels] = field(default_factory=dict)
    light: Annotated[tuple[Misfit, ...], Len(0, 3)] = ()
    place: Annotated[tuple[Misfit, ...], Len(0, 3)] = ()
    flattery: Decibels = 0.0
    flattery_error: Annotated[float, Interval(ge=0, le=100)] = 0.0

    @property
    def words(self) -> str:
        """All of it in a sentence without a full stop; empty for a profile that is no twin."""
        if not self.of:
            return ""
        gaps = [f"{method} {gap:.1f}" for method, gap in self.gap.items()]
        warning = f", more than {MOST:g} dB: it does not tell which method that learns is better" * (
            self.flattery > MOST
        )
        off = ""
        if self.light and self.place:
            off = f" (off by {max(self.light):.1%} of the light and by {max(self.place):.2f} px, besides noise)"
        return (
            f"a twin of {self.of}, trained with {self.photographs} photographs: its captures are further from a "
            f"photograph than a second photograph is by {', '.join(gaps)} dB{off}, and holograms made through it score "
            f"{self.flattery:.1f} ± {self.flattery_error:.1f} dB too high on it{warning}"
        )
