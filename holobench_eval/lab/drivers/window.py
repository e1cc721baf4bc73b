"""A full-screen window that holds one picture, pixel by pixel, drawn by OpenGL through pyglet."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...core.errors import UserError
from ...imaging.convention import Levels
from .driver import import_package


def load_pyglet() -> Any:
    """The package pyglet with what a window needs. UserError where it or the system's OpenGL is missing."""
    pyglet = import_package("monitor", "pyglet", "pyglet", "monitor")
    pyglet.options["shadow_window"] = False  # a second, hidden window, in whichever thread imports first
    pyglet.options["dpi_scaling"] = "real"  # a pixel of the window is a pixel of the panel
    try:
        import pyglet.display
        import pyglet.gl
        import pyglet.window
    except Exception as error:
        raise UserError(f"pyglet cannot draw here, is OpenGL installed? ({error})") from error
    return pyglet


def screens() -> list[Any]:
    """The monitors that the desktop knows now, as pyglet's screens. UserError where there is no desktop."""
    pyglet = load_pyglet()
    try:
        display = pyglet.display.Display(os.environ.get("DISPLAY"))
        # outputs without a picture are listed with no pixels
        return [screen for screen in display.get_screens() if screen.width and screen.height]
    except Exception as error:
        raise UserError(f"no desktop to show a window on: {error}") from error


class Window:
    """A borderless window over the whole of one screen; lives on the thread that makes it."""

    def __init__(self, screen: Any) -> None:
        pyglet = load_pyglet()
        self._gl: Any = pyglet.gl
        config = pyglet.gl.Config(
            double_buffer=True, red_size=8, green_size=8, blue_size=8, sample_buffers=0, samples=0, depth_size=0
        )
        # pyglet's own locks the mouse into a full-screen window on X, and nobody could reach the desktop any more
        panel = type("Panel", (pyglet.window.Window,), {"_update_exclusivity": lambda _: None})
        self._window: Any = panel(
            fullscreen=True, screen=screen, vsync=True, config=config, caption="holobench_eval", visible=True
        )
        # neither Escape nor the desktop's close button takes the panel away in the middle of a study
        self._window.push_handlers(on_key_press=lambda *_: True, on_close=lambda *_: True)
        self._window.set_mouse_visible(False)
        self._texture, self._source = self._gl.GLuint(), self._gl.GLuint()
        self._window.switch_to()
        gl = self._gl
        for feature in (gl.GL_DITHER, gl.GL_BLEND, gl.GL_FRAMEBUFFER_SRGB, gl.GL_SCISSOR_TEST, gl.GL_MULTISAMPLE):
            gl.glDisable(feature)
        gl.glGenTextures(1, self._texture)
        gl.glGenFramebuffers(1, self._source)
        gl.glBindTexture(gl.GL_TEXTURE_2D, self._texture)
        for parameter in (gl.GL_TEXTURE_MIN_FILTER, gl.GL_TEXTURE_MAG_FILTER):
            gl.glTexParameteri(gl.GL_TEXTURE_2D, parameter, gl.GL_NEAREST)

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of pixels that OpenGL draws, which an operating system's scaling makes others."""
        columns, rows = self._window.get_framebuffer_size()
        return rows, columns

    def pump(self) -> None:
        """Answer the desktop, which otherwise takes the window for dead and covers it."""
        self._window.dispatch_events()

    def draw(self, levels: Levels) -> NDArray[np.uint8]:
        """Put ``(H, W)`` levels on the screen, in red, green and blue alike, and read ``(H, W, 3)`` back.

        What is read is the picture in OpenGL's memory, top row first, just before it goes out.
        """
        gl, (rows, columns) = self._gl, levels.shape
        self._window.switch_to()
        self.pump()
        pixels = np.repeat(levels[..., None], 4, axis=2)
        pixels[..., 3] = 255
        gl.glBindTexture(gl.GL_TEXTURE_2D, self._texture)
        gl.glPixelStorei(gl.GL_UNPACK_ALIGNMENT, 1)
        gl.glTexImage2D(
            gl.GL_TEXTURE_2D, 0, gl.GL_RGBA8, columns, rows, 0, gl.GL_RGBA, gl.GL_UNSIGNED_BYTE, pixels.tobytes()
        )
        gl.glBindFramebuffer(gl.GL_READ_FRAMEBUFFER, self._source)
        gl.glFramebufferTexture2D(gl.GL_READ_FRAMEBUFFER, gl.GL_COLOR_ATTACHMENT0, gl.GL_TEXTURE_2D, self._texture, 0)
        # the second time round both buffers hold the picture, and the first one has been on the screen
        self._blit(rows, columns)
        self._window.flip()
        self._blit(rows, columns)
        back = self._read(rows, columns)
        self._window.flip()
        gl.glFinish()
        self.pump()
        return back

    def close(self) -> None:
        """Take the window away."""
        self._window.close()

    def _blit(self, rows: int, columns: int) -> None:
        """Copy pixel to pixel, the first row to the top: no shader, no filter."""
        gl = self._gl
        gl.glBindFramebuffer(gl.GL_READ_FRAMEBUFFER, self._source)
        gl.glBindFramebuffer(gl.GL_DRAW_FRAMEBUFFER, 0)
        gl.glBlitFramebuffer(0, 0, columns, rows, 0, rows, columns, 0, gl.GL_COLOR_BUFFER_BIT, gl.GL_NEAREST)

    def _read(self, rows: int, columns: int) -> NDArray[np.uint8]:
        gl = self._gl
        gl.glBindFramebuffer(gl.GL_READ_FRAMEBUFFER, 0)
        gl.glReadBuffer(gl.GL_BACK)
        gl.glPixelStorei(gl.GL_PACK_ALIGNMENT, 1)
        buffer = (gl.GLubyte * (rows * columns * 4))()
        gl.glReadPixels(0, 0, columns, rows, gl.GL_RGBA, gl.GL_UNSIGNED_BYTE, buffer)
        return np.frombuffer(buffer, np.uint8).reshape(rows, columns, 4)[::-1, :, :3]
