"""How long a bench takes from showing a hologram to a photograph that shows nothing of the one before: measured."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..imaging.warp import Array
from .devices import DeviceError
from .exposure import ORDER, WAITING, late

STEPS = (0.005, 0.01, 0.02, 0.04, 0.08, 0.16, 0.32, 0.64, 1.0)  # waiting times that are tried [s]
PATIENCE = 1.5  # seconds after which everything must have settled
TOLERANCE = 0.02  # of the change between the two patterns
UNSTEADY = 0.1  # of the change: more from frame to frame, and nothing can be measured
MARGIN = 1.5  # of the measured time
FAINTEST = 0.05  # of the brighter picture: a smaller change between the two is none
BLIND = "the picture does not change with the hologram; is this the panel that the camera sees?"
BRIGHT = 0.9  # quantile: samples that change most tell


@dataclass(frozen=True)
class Toggle:
    """A bright and a dark pattern that can be shown in turn.

    show: the bright one (True) or the dark one, returning when the driver does; take: the picture at once,
    ``(Hs, Ws)`` counts; wait: seconds.
    """

    show: Callable[[bool], None]
    take: Callable[[], Array]
    wait: Callable[[float], None]

    def after(self, bright: bool, seconds: float) -> Array:
        """The picture ``seconds`` after the other pattern, long settled, has been replaced by this one."""
        self.show(not bright)
        self.wait(PATIENCE)
        self.show(bright)
        self.wait(seconds)
        return self.take()


def refuse_old(toggle: Toggle, seconds: float) -> tuple[list[Array], list[Array]]:
    """Pictures of the bright and of the dark pattern, so long after they were shown.

    DeviceError for a camera whose first one is of the pattern before.
    """
    shown: list[int] = []

    def take(kind: int) -> Array:
        if shown[-1:] != [kind]:
            toggle.show(kind == 0)
            toggle.wait(seconds)
        shown.append(kind)
        return toggle.take()

    count, pictures = late(take)
    if count is None:
        raise DeviceError(BLIND)
    if count > WAITING:
        raise DeviceError(
            f"pictures {seconds:g} s after holograms were shown do not follow them; does the panel show the one "
            "before, settle slowly or flicker, or the laser's power change?"
        )
    if count:
        raise DeviceError(
            f"frame {count + 1} after {seconds:g} s to settle is the first of a hologram; empty the camera's queue "
            "of frames, trigger each, or let the panel settle for longer"
        )
    bright, dark = ([each for each, kind in zip(pictures, ORDER, strict=True) if kind == wanted] for wanted in (0, 1))
    return bright, dark


def settle_time(toggle: Toggle) -> float:
    """Seconds to wait after showing a hologram, with a margin; panel, driver and camera all have their part in it.

    The photographed level, 0 for the dark pattern and 1 for the bright one, must be within `TOLERANCE` of its end
    (more where frames differ by more), after this time and after twice as long, on the way up and on the way down.
    DeviceError, in one line, for a bench that shows no change, is unsteady, or takes longer than `PATIENCE`.
    """
    level, noise = _settled(toggle)
    tolerance = max(TOLERANCE, 3 * noise)
    first = None
    for seconds in STEPS:
        ends = [(bright, level(toggle.after(bright, seconds))) for bright in (True, False)]
        if any(abs(seen - bright) > tolerance for bright, seen in ends):
            first = None
        elif first is not None:
            return MARGIN * first
        else:
            first = seconds
    raise DeviceError(
        f"the picture still changes {STEPS[-1]:g} s after a hologram was shown; does the panel's driver queue frames, "
        "or the camera give old ones?"
    )


def _settled(toggle: Toggle) -> tuple[Callable[[Array], float], float]:
    """How to read the level of a picture, and how much it varies (rms) when all has settled."""
    bright, dark = refuse_old(toggle, PATIENCE)
    change = np.abs(bright[0] - dark[0])
    telling = change >= np.quantile(change, BRIGHT)
    base = float(max(np.mean(each[telling]) for each in (bright[0], dark[0])))
    if not np.mean(change[telling]) > FAINTEST * base:
        raise DeviceError(BLIND)
    weights = np.where(telling, bright[0] - dark[0], 0.0)
    bottom = float(np.mean([np.sum(weights * each) for each in dark]))
    top = float(np.mean([np.sum(weights * each) for each in bright]))
    span = top - bottom

    def level(picture: Array) -> float:
        return (float(np.sum(weights * picture)) - bottom) / (span or 1e-12)

    noise = float(
        np.sqrt(np.mean([(level(each) - kind) ** 2 for kind, some in ((1, bright), (0, dark)) for each in some]))
    )
    if not span > 0 or noise > UNSTEADY:
        raise DeviceError(
            f"the picture of one and the same hologram still changes by {noise:.0%} after {PATIENCE:g} s; "
            "look at the laser's power, the panel's flicker and its speed"
        )
    return level, noise
