"""Who competes with whom: methods are ranked among those that were given as much of the camera."""

from __future__ import annotations

OPEN_LOOP = "open loop"
CALIBRATED = "calibrated"
ONLINE = "online"
ORACLE = "oracle"
GIVEN = "given"
FLOOR = "floor"  # in files, of rows that no method made

# In the order of tables.
CATEGORIES = (OPEN_LOOP, CALIBRATED, ONLINE, ORACLE, GIVEN)
# Methods that, as far as is known, never see a capture of the scored image: their holograms are ready before it.
OFFLINE = (OPEN_LOOP, CALIBRATED, GIVEN)
