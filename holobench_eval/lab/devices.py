"""What a spatial light modulator and a camera have to be able to do, whoever makes them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from ..imaging.convention import Levels

Counts = NDArray[np.uint8] | NDArray[np.uint16]


class DeviceError(Exception):
    """A device does not answer, or did not do what it was asked to: one line that says what to look at."""


class Slm(Protocol):
    """A panel that shows 8-bit levels."""

    @property
    def name(self) -> str:
        """What it calls itself, for records."""

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns in pixels."""

    def show(self, levels: Levels) -> None:
        """Show ``(H, W)`` uint8 levels, bit-exact; returns when the driver says they are shown.

        DeviceError when they are not: what can be read back is read back. Settling is waited for by the caller.
        """

    def close(self) -> None:
        """Give the device back; more than once does nothing."""


@runtime_checkable
class SequenceSlm(Slm, Protocol):
    """A panel that shows several patterns within one exposure: what ``panel.frames`` above 1 needs."""

    def show_sequence(self, frames: Sequence[Levels]) -> None:
        """Show ``(H, W)`` uint8 levels in turn, for equal times, again and again until the next call of ``show``.

        Returns when the first has begun; DeviceError as ``show``. Every exposure holds whole turns: the driver
        triggers the camera, or turns so fast that a part of one does not matter.
        """


class Camera(Protocol):
    """A camera with a linear sensor and an exposure time that can be set."""

    @property
    def name(self) -> str:
        """Model and serial number as far as it tells them, for records."""

    @property
    def white(self) -> float:
        """Counts at which a sample is saturated."""

    @property
    def exposures(self) -> tuple[float, float]:
        """Shortest and longest exposure [s]."""

    def expose(self, seconds: float) -> tuple[Counts, float]:
        """One fresh frame, ``(Hs, Ws)`` or ``(Hs, Ws, 3)`` red, green, blue, and the exposure [s] it really had.

        Raw linear counts, low-justified: no gamma, white balance, denoising or automatic gain. The exposure starts
        after the call does, so that no frame of an earlier pattern is ever returned. DeviceError when no frame comes.
        """

    def close(self) -> None:
        """Give the device back; more than once does nothing."""
