"""Who competes with whom: methods are ranked among those that were given as much of the camera."""

from __future__ import annotations

from collections.abc import Iterable

OPEN_LOOP = "open loop"
CALIBRATED = "calibrated"
ONLINE = "online"
CEILING = "ceiling"
GIVEN = "given"

TRACKS = (OPEN_LOOP, CALIBRATED, ONLINE, CEILING, GIVEN)
"""In the order of tables."""

OFFLINE = (OPEN_LOOP, CALIBRATED, GIVEN)
"""The tracks whose methods never see a capture of the scored image, as far as is known: their holograms are ready
before it is shown."""

_MEANINGS = {
    OPEN_LOOP: "knows the nominal optics and takes no captures at all.",
    CALIBRATED: "was trained on captures of other images before any target was seen, and takes none of a scored "
    "image; its captures are spent once, however many images follow.",
    ONLINE: "sees, through the camera, captures of the very image that is scored while it solves; it spends captures "
    "on every image, and needs the camera in front of the display for as long as the display is in use.",
    CEILING: "may differentiate through the simulated bench, which no real method can, and is not ranked.",
    GIVEN: "gave pictures alone; what it was given of the camera is not known.",
}


def meanings(found: Iterable[str]) -> list[tuple[str, str]]:
    """(track, what it means) of the tracks that are there, in their order."""
    there = set(found)
    return [(track, _MEANINGS[track]) for track in TRACKS if track in there]
