"""What a monitor really shows, as far as an operating system tells: its pixels, and the curve they are sent through."""

from __future__ import annotations

import ctypes
import ctypes.util
import os
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..devices import DeviceError


def grab(x: int, y: int, rows: int, columns: int) -> NDArray[np.uint8]:
    """The ``(H, W, 3)`` pixels of a part of the desktop, whichever windows are there.

    DeviceError where the desktop does not let programs see its screen, as under Wayland.
    """
    from PIL import ImageGrab

    try:
        picture = ImageGrab.grab((x, y, x + columns, y + rows), xdisplay=os.environ.get("DISPLAY", ""))
        return np.asarray(picture.convert("RGB"))
    except Exception as error:
        raise DeviceError(
            f"the desktop does not tell what is on its screen ({error}); where it never does, set check: framebuffer"
        ) from error


def gamma_is_straight(screen: Any) -> bool | None:
    """Whether levels leave for a pyglet screen as they are; None where it cannot be known.

    A calibration loader or a night light bends this curve behind the back of every program.
    """
    try:
        curve = _ramp_of_x(screen)
    except (OSError, AttributeError, ValueError):  # no such library, no such function, no curve
        return None
    entries = np.linspace(0, curve.shape[1] - 1, 256).round().astype(int)
    # systems disagree whether level n is n * 256 or n * 257
    return bool(np.all(np.abs(curve[:, entries].astype(int) - 257 * np.arange(256)) < 257))


def _ramp_of_x(screen: Any) -> NDArray[np.uint16]:
    class Gamma(ctypes.Structure):
        _fields_ = (
            ("size", ctypes.c_int),
            ("red", ctypes.POINTER(ctypes.c_ushort)),
            ("green", ctypes.POINTER(ctypes.c_ushort)),
            ("blue", ctypes.POINTER(ctypes.c_ushort)),
        )

    x11, xrandr = (ctypes.CDLL(ctypes.util.find_library(name)) for name in ("X11", "Xrandr"))
    x11.XOpenDisplay.restype = ctypes.c_void_p
    x11.XCloseDisplay.argtypes = [ctypes.c_void_p]
    xrandr.XRRGetCrtcGamma.restype = ctypes.POINTER(Gamma)
    xrandr.XRRGetCrtcGamma.argtypes = [ctypes.c_void_p, ctypes.c_ulong]
    xrandr.XRRFreeGamma.argtypes = [ctypes.POINTER(Gamma)]
    display = x11.XOpenDisplay(os.environ.get("DISPLAY", "").encode() or None)
    if not display:
        raise OSError("no X server")
    try:
        pointer = xrandr.XRRGetCrtcGamma(display, screen.crtc_id)
        if not pointer or pointer.contents.size < 2:
            raise ValueError("no curve")
        gamma = pointer.contents
        curves = [np.ctypeslib.as_array(side, (gamma.size,)).copy() for side in (gamma.red, gamma.green, gamma.blue)]
        xrandr.XRRFreeGamma(pointer)
        return np.stack(curves)
    finally:
        x11.XCloseDisplay(display)
