"""Who competes with whom: methods are ranked among those that were given as much of the camera."""

from __future__ import annotations

from collections.abc import Container

OPEN_LOOP = "open loop"
CALIBRATED = "calibrated"
ONLINE = "online"
ORACLE = "ceiling"
GIVEN = "given"
FLOOR = "floor"  # in files, of rows that no method made

# In the order of tables.
CATEGORIES = (OPEN_LOOP, CALIBRATED, ONLINE, ORACLE, GIVEN)
# Methods that, as far as is known, never see a capture of the scored image: their holograms are ready before it.
OFFLINE = (OPEN_LOOP, CALIBRATED, GIVEN)

_MEANINGS = {
    OPEN_LOOP: "knows the nominal optics and takes no captures at all.",
    CALIBRATED: "is trained on captures of other images before any target is seen, and takes none of a scored image; "
    "its captures are spent once, for any number of images.",
    ONLINE: "captures the scored image itself while it solves; it spends captures on every image, and needs a camera "
    "in front of the display in use.",
    ORACLE: "may differentiate through the simulated bench, which no real method can, and is not ranked.",
    GIVEN: "gave pictures only; its access to the camera is unknown.",
}


def meanings(present: Container[str]) -> list[tuple[str, str]]:
    """(category, what it means) of those that are present, in their order."""
    return [(category, _MEANINGS[category]) for category in CATEGORIES if category in present]
