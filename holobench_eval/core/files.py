"""Files that anybody may have written: regular ones alone, no larger than they may be, checked before they are read."""

from __future__ import annotations

import io
import os
import re
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Final

from .errors import UserError

CONTROLS: Final = re.compile(r"[\x00-\x1f\x7f-\x9f\u2028\u2029\u202a-\u202e\u2066-\u2069]")
"""Signs that a terminal obeys, or that turn the direction of what follows."""


@contextmanager
def open_regular(path: Path, most: int) -> Iterator[IO[bytes]]:
    """A file, open for reading in bytes within a ``with``.

    Parameters
    ----------
    path : Path
        A regular file, or a link to one.
    most : int
        Its bytes at most.

    Yields
    ------
    IO[bytes]
        The open file.

    Raises
    ------
    UserError
        A pipe or a device, which may never end, or a larger file.
    OSError
        There is no such file, or it cannot be opened.
    """
    with open(path, "rb", opener=_at_once) as file:
        state = os.fstat(file.fileno())
        if not stat.S_ISREG(state.st_mode):
            raise UserError(f"{path}: a pipe or a device; expected a regular file")
        if state.st_size > most:
            size = f"{state.st_size / 1e6:.1f} MB"
            raise UserError(f"{path}: {size}, larger than the {most / 1e6:g} MB that such a file may have")
        yield file


def _at_once(path: str, flags: int) -> int:
    """Open without waiting, as a pipe would have one do until somebody writes into it."""
    return os.open(path, flags | getattr(os, "O_NONBLOCK", 0))


def read_regular(path: Path, most: int) -> bytes:
    """The bytes of a file, see `open_regular`."""
    with open_regular(path, most) as file:
        return file.read(most)


def read_text(path: Path, most: int) -> str:
    """The text of a file in UTF-8, with the ends of lines as ``\\n``, see `open_regular`. UserError: not UTF-8."""
    with open_regular(path, most) as file:
        try:
            with io.TextIOWrapper(file, encoding="utf-8") as text:
                return text.read()
        except UnicodeDecodeError as error:
            raise UserError(f"{path}: not UTF-8 text ({error.reason} at byte {error.start})") from None
