"""The medium that figures are drawn for: a page on a screen, a slide, or one or two columns of print."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass

DPI = 100
MILLIMETRES = 25.4  # an inch
NARROW = 500  # pixels
ADVANCE = 0.6  # of the font's size, that an average character is wide


@dataclass(frozen=True)
class Medium:
    """width: of a figure [pixels of 1/100 inch]; text, note: sizes of labels and of what stands beside marks [pt];
    suffixes: the files that a chart is written as."""

    width: int
    text: float
    note: float
    suffixes: tuple[str, ...]

    @property
    def scale(self) -> float:
        """Of heights that were chosen for the screen."""
        return self.text / SCREEN.text

    @property
    def narrow(self) -> bool:
        """Whether two panels stand below each other and not side by side."""
        return self.width < NARROW

    def characters(self, pixels: float) -> int:
        """How many characters of a label fit a width [pixels], at least eight."""
        return max(8, int(pixels / (ADVANCE * self.text * DPI / 72)))

    def wrap(self, words: str, pixels: float) -> str:
        """Words in lines that fit a width [pixels]."""
        return textwrap.fill(words, self.characters(pixels), break_long_words=False, break_on_hyphens=False)


SCREEN = Medium(900, 9, 8, (".png",))
# A column and two columns of the ACM's and of most journals are 84 and 174 mm wide; 7 pt is the smallest font that they
# accept. A slide of 16:9 is 1280 pixels wide, and read from the last row.
MEDIA = {
    "talk": Medium(1280, 16, 14, (".png", ".svg")),
    "column": Medium(int(84 * DPI / MILLIMETRES), 7, 7, (".pdf", ".svg")),
    "double": Medium(int(174 * DPI / MILLIMETRES), 7, 7, (".pdf", ".svg")),
}

_current = ContextVar("medium", default=SCREEN)


def medium() -> Medium:
    """The medium that figures are drawn for."""
    return _current.get()


@contextmanager
def drawn_for(chosen: Medium) -> Iterator[None]:
    """Draw the figures within for another medium."""
    token = _current.set(chosen)
    try:
        yield
    finally:
        _current.reset(token)
