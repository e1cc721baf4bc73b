"""Eyes that need glasses, and holograms that are the glasses (paper 4.2, end; Maimone et al. 2017, Section 4.4)."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

from ....core.errors import UserError
from ....optics.phase import Matrix
from ..profile import Profile

EYEPIECE = 0.05  # focal length [m] of the eyepiece through which the image is seen; assumed, usual in near-eye displays
STRONGEST = 10.0  # dioptres, of a prescription's sphere and cylinder
NAMES = f"prescriptions, such as '-2' or '-2 / -1 x 30', of at most {STRONGEST:g} dioptres"
WRITTEN = re.compile(r"([+-]?\d+(?:\.\d+)?)(?:\s*/\s*([+-]?\d+(?:\.\d+)?)\s*x\s*(\d+(?:\.\d+)?))?")


@dataclass(frozen=True)
class Prescription:
    """Glasses as an optometrist writes them: sphere and cylinder [dioptres], axis [degrees, counterclockwise].

    The cylinder has its power across its axis; an axis of 0 is horizontal.
    """

    sphere: float
    cylinder: float = 0.0
    axis: float = 0.0

    @classmethod
    def read(cls, text: str) -> Prescription:
        """``"-2"`` or ``"-2 / -1 x 30"``. UserError for anything else."""
        written = WRITTEN.fullmatch(text.strip())
        if written is None:
            raise UserError(f"prescription '{text}': write 'sphere' or 'sphere / cylinder x axis', as '-2 / -1 x 30'")
        sphere, cylinder, axis = (float(part or 0) for part in written.groups())
        if max(abs(sphere), abs(cylinder)) > STRONGEST or axis > 180:
            raise UserError(f"prescription '{text}': at most {STRONGEST:g} dioptres, and an axis of 0 to 180 degrees")
        return cls(sphere, cylinder, axis)

    def __str__(self) -> str:
        """As ``read`` takes it, in one form."""
        return f"{self.sphere:g} / {self.cylinder:g} x {self.axis:g}" if self.cylinder else f"{self.sphere:g}"

    def shift(self) -> Matrix:
        """By how much the plane that the relaxed eye sees is further away than the eyepiece's focal plane [m].

        A matrix over rows and columns of the image. An eye of -S dioptres is relaxed for light from 1 / S in front of
        the eyepiece, whose image lies at x = f^2 S from its focus, towards the eyepiece (Newton); the image of a
        hologram lies before the eyepiece, so that this is further away from the panel.
        """
        turn = math.radians(self.axis)
        down, along = math.cos(turn), math.sin(turn)  # across the axis; rows go down, so that both have one sign
        per_dioptre = -(EYEPIECE**2)
        return (
            per_dioptre * (self.sphere + self.cylinder * down * down),
            per_dioptre * (self.sphere + self.cylinder * along * along),
            per_dioptre * self.cylinder * down * along,
        )


def relative(profile: Profile, text: str) -> Matrix:
    """``Prescription.shift`` as a share of the panel's distance. UserError for one that the panel is too close for."""
    rows, columns, cross = (value / profile.panel.distance for value in Prescription.read(text).shift())
    if min(rows, columns) - abs(cross) <= -0.5 or max(rows, columns) + abs(cross) >= 0.5:
        raise UserError(f"prescription '{text}' moves the image by more than half of {profile.panel.distance:g} m")
    return rows, columns, cross


def one_form(text: str) -> str:
    """A prescription as ``Prescription`` writes it. UserError for one that cannot be read."""
    return str(Prescription.read(text))
