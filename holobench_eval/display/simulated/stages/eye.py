"""Stage 9, for an eye in the place of the camera: the distance at which it is relaxed, meridian by meridian."""

from __future__ import annotations

from dataclasses import dataclass

from ....optics.phase import Matrix


@dataclass(frozen=True)
class Eye:
    """A relaxed eye that sees the plane at z (1 + ``focus``) instead of the image's.

    focus: a matrix; astigmatism gives each meridian a distance of its own. See ``conditions.vision``. known: whether
    methods know the eye, as they know the nominal optics.
    """

    focus: Matrix = (0.0, 0.0, 0.0)
    known: bool = False
