"""A desktop with two monitors that nobody can see: the X server with its dummy driver, and eyes of another library."""

import ctypes.util
import os
import shutil
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np
import pytest

CONFIG = """
Section "ServerFlags"
  Option "AutoAddDevices" "false"
  Option "AutoAddGPU" "false"
  Option "BlankTime" "0"
EndSection
Section "Monitor"
  Identifier "desk"
  HorizSync 1-2000
  VertRefresh 1-2000
  Option "PreferredMode" "1024x768"
EndSection
Section "Monitor"
  Identifier "panel"
  HorizSync 1-2000
  VertRefresh 1-2000
  Option "PreferredMode" "1920x1080"
  Option "Enable" "true"
  Option "RightOf" "desk"
EndSection
Section "Device"
  Identifier "card"
  Driver "dummy"
  VideoRam 256000
  Option "Monitor-DUMMY0" "desk"
  Option "Monitor-DUMMY1" "panel"
EndSection
Section "Screen"
  Identifier "screen"
  Device "card"
  Monitor "desk"
  DefaultDepth 24
  SubSection "Display"
    Depth 24
    Modes "1024x768"
    Virtual 2944 1080
  EndSubSection
EndSection
"""
PANEL = {"name": "DUMMY1", "resolution": (1920, 1080)}
PANEL_AT = (1024, 0)


@contextmanager
def two_monitors() -> Iterator[str]:
    """The display number of a server of its own; skips where the X server, its driver or OpenGL is absent."""
    if not shutil.which("Xorg") or not Path("/usr/lib/xorg/modules/drivers/dummy_drv.so").is_file():
        pytest.skip("no X server with a dummy driver: apt-get install xserver-xorg-core xserver-xorg-video-dummy")
    if not ctypes.util.find_library("GL"):
        pytest.skip("no OpenGL: apt-get install libgl1 libgl1-mesa-dri")
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "xorg.conf").write_text(CONFIG)
        arguments = ["-config", "xorg.conf", "-logfile", f"{folder}/log", "-nolisten", "tcp"]
        reader, writer = os.pipe()
        server = subprocess.Popen(
            ["Xorg", "-displayfd", str(writer), *arguments, "-novtswitch", "-sharevts", "-noreset", "-retro"],
            cwd=folder,
            pass_fds=[writer],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        os.close(writer)
        try:
            with os.fdopen(reader) as answer:  # ends with the server, should it not start
                number = answer.readline().strip()
            if not number:
                log = Path(folder) / "log"
                pytest.skip(f"the X server does not start: {log.read_text()[-300:] if log.exists() else 'no log'}")
            yield f":{number}"
        finally:
            server.terminate()
            with suppress(subprocess.TimeoutExpired):
                server.wait(10)
            server.kill()


class Eyes:
    """What stands on the X server's screen, by python-xlib: no code in common with the driver's."""

    def __init__(self, name: str) -> None:
        xlib = pytest.importorskip("Xlib.display")
        self._display = xlib.Display(name)
        self._root = self._display.screen().root

    def panel(self) -> np.ndarray:
        """The ``(1080, 1920, 3)`` pixels where the second monitor is."""
        from Xlib import X

        image = self._root.get_image(*PANEL_AT, 1920, 1080, X.ZPixmap, 0xFFFFFFFF)
        return np.frombuffer(image.data, np.uint8).reshape(1080, 1920, 4)[..., 2::-1]

    @contextmanager
    def notice(self) -> Iterator[None]:
        """A small window in front of everything, such as a desktop's notification."""
        from Xlib import X

        window = self._root.create_window(
            PANEL_AT[0] + 1500, 900, 30, 20, 0, X.CopyFromParent, background_pixel=0x336699, override_redirect=True
        )
        window.map()
        self._display.sync()
        try:
            yield
        finally:
            window.destroy()
            self._display.sync()

    @contextmanager
    def bent_curve(self) -> Iterator[None]:
        """The panel's output with a gamma of 1.1, such as a calibration loads it."""
        from Xlib.ext import randr

        screen = randr.get_screen_resources(self._root)
        outputs = [randr.get_output_info(self._root, output, 0) for output in screen.outputs]
        crtc = next(output.crtc for output in outputs if output.name == "DUMMY1")
        before = randr.get_crtc_gamma(self._root, crtc)
        bent = [round(65535 * (entry / (len(before.red) - 1)) ** 1.1) for entry in range(len(before.red))]
        self._set(crtc, bent, bent, bent)
        try:
            yield
        finally:
            self._set(crtc, before.red, before.green, before.blue)

    def _set(self, crtc: int, *curves: list[int]) -> None:
        from Xlib.ext import randr

        randr.set_crtc_gamma(self._root, crtc, len(curves[0]), *curves)
        self._display.sync()

    def move_pointer(self, x: int, y: int) -> None:
        self._root.warp_pointer(x, y)
        self._display.sync()
        time.sleep(0.3)  # the server changes its shape a little later

    def pointer_is_visible(self) -> bool:
        self._display.xfixes_query_version()
        picture = self._display.xfixes_get_cursor_image(self._root)
        return any(pixel >> 24 for pixel in picture.cursor_image)

    def close(self) -> None:
        self._display.close()
