"""A panel that is driven as a second monitor (driver ``monitor``, extra ``[monitor]``)."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np
from annotated_types import Interval, MinLen
from numpy.typing import NDArray

from ...core.errors import UserError
from ...imaging.convention import Levels
from ..devices import DeviceError
from .driver import Driver, only
from .screen_check import gamma_is_straight, grab
from .window import Window, screens
from .worker import asked, closed_on_failure

SECONDS = 20.0  # a graphics driver that takes longer hangs
GRABS = 20  # a desktop may take some frames until a new picture is on its screen

Side = Annotated[int, Interval(ge=1, le=32768)]


@dataclass(frozen=True)
class MonitorSettings:
    """Which monitor is the panel.

    name: what the desktop calls it, such as ``HDMI-1`` (``holoeval doctor`` lists them), never a number, since
    numbers change when a cable is moved; resolution: its columns and rows; check: what every picture is read back
    from: ``screen``, what the desktop shows there, whichever windows and scaling are in between, or ``framebuffer``,
    the graphics memory only, for desktops that hide their screen from programs.
    """

    name: Annotated[str, MinLen(1)]
    resolution: tuple[Side, Side]
    check: Literal["screen", "framebuffer"] = "screen"


class MonitorSlm:
    """A monitor as a device that `Own` takes: full screen, pixel to pixel, read back after every picture."""

    def __init__(self, settings: MonitorSettings) -> None:
        """UserError: no such monitor, or several; no desktop, no OpenGL. DeviceError: the window is not as asked."""
        if sys.platform == "darwin":
            raise UserError("driver 'monitor' does not work on macOS, which allows windows in the main thread only")
        self._settings = settings
        columns, rows = settings.resolution
        self.shape = rows, columns
        self.name = f"monitor {settings.name} {columns}x{rows}"
        self._window: Window | None = None
        with closed_on_failure(self.close):
            self._screen = matching(screens(), self._settings)
            self._window = Window(self._screen)
            if self._window.shape != self.shape:
                rows, columns = self._window.shape
                raise DeviceError(
                    f"{self.name}: the window has {columns}x{rows} pixels; set this monitor's scaling to 100 %"
                )

    def show(self, levels: Levels) -> None:
        """Show ``(H, W)`` uint8 levels and read them back; returns after the second refresh of the screen.

        DeviceError where a pixel of what was read back is another: scaling, colour management, dithering, a bent
        gamma curve, something in front of the window.
        """
        assert self._window is not None
        back = self._window.draw(levels)
        if altered := _difference(back, levels):
            raise DeviceError(f"{self.name}: the graphics driver altered the picture: {altered}")
        if gamma_is_straight(self._screen) is False:
            raise DeviceError(
                f"{self.name}: its gamma curve is bent; switch off colour management and night light for this monitor"
            )
        if self._settings.check == "framebuffer":
            return
        rows, columns = self.shape
        for _ in range(GRABS):
            altered = _difference(grab(self._screen.x, self._screen.y, rows, columns), levels)
            if not altered:
                return
            self._window.pump()
        raise DeviceError(
            f"{self.name}: the screen does not show the picture: {altered}; look for a window or notice in front of "
            "it, scaling, colour management, dithering"
        )

    def idle(self) -> None:
        """Look after the window."""
        if self._window:
            self._window.pump()

    def close(self) -> None:
        """Take the window away."""
        if self._window:
            self._window.close()
            self._window = None


def matching(screens: Sequence[Any], settings: MonitorSettings) -> Any:
    """The one screen with the name and the resolution that are asked for; UserError that lists all for none or more."""
    wanted = (settings.name.strip().lower(), *settings.resolution)
    fitting = [screen for screen in screens if (_name(screen).lower(), screen.width, screen.height) == wanted]
    asked = f"{settings.name} {settings.resolution[0]}x{settings.resolution[1]}"
    return only("monitor", asked, fitting, described(screens))


def described(screens: Sequence[Any]) -> list[str]:
    """``HDMI-1 1920x1080`` for every screen."""
    return [f"{_name(screen)} {screen.width}x{screen.height}" for screen in screens]


def list_monitors() -> list[str]:
    """The monitors of this desktop; UserError where there is none."""
    return asked("the desktop", "listing its monitors", SECONDS, lambda: described(screens()))


def _name(screen: Any) -> str:
    return str(screen.get_monitor_name()).strip()


def _difference(picture: NDArray[np.uint8], levels: Levels) -> str:
    if picture.shape[:2] != levels.shape:
        return f"it has {picture.shape[1]}x{picture.shape[0]} pixels"
    wrong = np.any(picture != levels[..., None], axis=2)
    if not wrong.any():
        return ""
    row, column = (int(index) for index in np.argwhere(wrong)[0])
    got = ", ".join(str(level) for level in picture[row, column])
    return (
        f"{np.count_nonzero(wrong)} of {wrong.size} pixels, the first at row {row}, column {column}: "
        f"red, green, blue {got} for {levels[row, column]}"
    )


DRIVERS = (Driver("slm", "monitor", MonitorSettings, MonitorSlm, "pyglet", "monitor", list_monitors),)
