"""In which order the patterns of a round are shown: mixed, with dark frames and repeats, so that drift is seen."""

from __future__ import annotations

import random
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from ..photograph import Request
from ..preflight import EXPOSURES
from .manifest import DARK, FIDUCIAL, HOLOGRAM, LETTER, REPEAT, REVERSED

BETWEEN_REPEATS = 24  # holograms between two showings of the repeated pattern


@dataclass(frozen=True)
class Showing:
    """A request at its place in a round. request: None for a dark frame; exposure: of that, relative."""

    role: str
    request: Request | None
    copy: int = 0
    exposure: float = 1.0


def ordered(
    requests: Sequence[Request], repeated: Request, seed: str, exposures: Sequence[float], dark: bool
) -> Iterator[Showing]:
    """The showings of a round.

    Dark frames, where ``dark``, first and last, at the shortest and at the longest of the round's relative
    ``exposures``, since stray light and dark current grow with the time and an offset does not; then the fiducial
    holograms; then everything else in a random order that ``seed`` names, since a slow drift must not favour the
    methods that are shown first; and one hologram of the fiducial grid, ``repeated``, at the beginning, every so often,
    and at the end.
    """
    copies, spread = iter(range(1_000_000)), sorted({min(exposures), max(exposures)}) if dark else []
    yield from (Showing(DARK, None, 0, exposure) for exposure in spread)
    yield Showing(REPEAT, repeated, next(copies))
    yield from (Showing(FIDUCIAL, request) for request in requests if request.role == FIDUCIAL)
    mixed = [request for request in requests if request.role == HOLOGRAM]
    random.Random(seed).shuffle(mixed)
    for index, request in enumerate(mixed):
        if index and index % BETWEEN_REPEATS == 0:
            yield Showing(REPEAT, repeated, next(copies))
        yield Showing(HOLOGRAM, request)
    yield Showing(REPEAT, repeated, next(copies))
    yield from (Showing(DARK, None, 1, exposure) for exposure in spread)


def check_showings(fixed_exposure: bool) -> list[tuple[str, float]]:
    """Role and relative exposure of what checks the bench, in the order of showing.

    Dark frames at the ends of the exposures; the letter at the longest, which chooses the samples that linearity is
    measured on; the letter at all; the letter with the other sign. A camera with one exposure cannot show linearity.
    """
    if fixed_exposure:
        return [(DARK, 1.0), (LETTER, 1.0), (REVERSED, 1.0)]
    ends = [(DARK, exposure) for exposure in (min(EXPOSURES), max(EXPOSURES))]
    return [*ends, (LETTER, 1.0), *((LETTER, exposure) for exposure in EXPOSURES), (REVERSED, 1.0)]
