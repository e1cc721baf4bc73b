"""A fixed phase on the study's bench, scored before and after a method of somebody else's code that runs inside.

If a digit changes, the method has changed the harness for all that come after it, and the run stops.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress

import torch

from ...core import plugins
from ...core.errors import CellError, StopError
from ...core.seeds import generator
from ...metrics import score
from .. import opening
from ..definition import Study
from ..displays import Condition

SIDE = 192  # pixels of the scored part at most: all metrics work on it, and it takes a fifth of a second

Digits = dict[str, float]

_before: dict[tuple[object, ...], Digits] = {}  # by display, panel and seed, from before the first such method


@contextmanager
def guarded(method: str, study: Study, display: Condition) -> Iterator[None]:
    """Around what a ``method`` does, by its name in a config. StopError: it has changed the harness.

    Methods of this package are not guarded, nor those in a process of their own. What a thread changes later is not
    seen.
    """
    if study.isolation != "none" or plugins.is_shipped("methods", method):
        yield
        return
    key = (display.digest, display.name, display.spec.shape, study.seed)
    if key not in _before:
        _before[key] = digits(display, study.seed)
    try:
        yield
    finally:
        before, after = _before[key], digits(display, study.seed)
        changed = sorted(name for name in before.keys() | after.keys() if before.get(name) != after.get(name))
        if changed:
            found = f"after it, the same phase on {display.name} has another {changed[0]}"
            remedy = "no score after it can be trusted. Mend its file, and run the same command again"
            raise StopError(f"method '{method}' has changed the harness: {found}; {remedy}")


def digits(display: Condition, seed: int) -> Digits:
    """The scores of a fixed phase on a simulated bench; of a fixed image in the place of other displays' captures."""
    spec = display.spec
    draw = generator("reference cell")
    target = torch.rand((len(spec.wavelengths), *spec.region.shape), generator=draw)
    image = target + 0.1
    if display.real is None and display.learned is None:
        phase = 6 * torch.rand((len(spec.wavelengths), *spec.shape), generator=draw)
        with suppress(CellError):  # a display that cannot be calibrated fails every cell by itself
            bench = opening.open_display(display, seed)
            image = bench.photograph(phase, target, item="reference cell", repeat=0).image
    part = (slice(None), slice(SIDE), slice(SIDE))
    return score(image[part], target[part])
