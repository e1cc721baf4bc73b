"""Files: regular ones alone are read; written whole or not at all, under names that any folder takes; locked."""

from __future__ import annotations

import fcntl
import hashlib
import io
import os
import re
import stat
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import IO, TYPE_CHECKING, Final

from .errors import StorageError, UserError
from .hashing import digest

if TYPE_CHECKING:
    from torch import Tensor

TEMPORARY = ".writing-"  # how the name of a file begins that is not whole yet
SEAL = hashlib.sha256().digest_size  # bytes at the end of a sealed file
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
    # without waiting, as a pipe would have one do until somebody writes into it
    with open(path, "rb", opener=lambda name, flags: os.open(name, flags | os.O_NONBLOCK)) as file:
        state = os.fstat(file.fileno())
        if not stat.S_ISREG(state.st_mode):
            raise UserError(f"{path}: a pipe or a device; expected a regular file")
        if state.st_size > most:
            size = f"{state.st_size / 1e6:.1f} MB"
            raise UserError(f"{path}: {size}, larger than the {most / 1e6:g} MB that such a file may have")
        yield file


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


def now() -> str:
    """The present time, UTC, to the second."""
    return datetime.now(UTC).isoformat(timespec="seconds")


def write_atomically(path: Path, content: bytes, lasting: bool = True) -> None:
    """Write a file under a temporary name in the same folder, then rename it: readers see all of it or nothing.

    Parameters
    ----------
    path : Path
        The file. Its folder is created where there is none, and a file of this name is replaced.
    content : bytes
        What the file holds afterwards.
    lasting : bool
        Wait until the disk has it, so that it outlives a loss of power; what can be made again need not.

    Raises
    ------
    StorageError
        The file cannot be written; nothing is left behind, and an older file of this name stays as it was.

    Examples
    --------
    >>> from tempfile import mkdtemp
    >>> path = Path(mkdtemp(), "new folder", "note.txt")
    >>> write_atomically(path, b"all or nothing")
    >>> path.read_bytes()
    b'all or nothing'
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(prefix=TEMPORARY, dir=path.parent)
        temporary = Path(name)
        try:
            with os.fdopen(handle, "wb") as file:
                file.write(content)
                file.flush()
                if lasting:
                    os.fsync(file.fileno())
            temporary.chmod(0o644)
            temporary.replace(path)
        except BaseException:
            temporary.unlink(missing_ok=True)
            raise
    except OSError as error:
        reason = f"{path} cannot be written: {error.strerror}; mend that, and run the same command again"
        raise StorageError(reason) from error


@contextmanager
def locked(file: Path, waits: bool = True) -> Iterator[None]:
    """Keep others out that lock the same file, whose folder is made. The lock dies with its process, so it never
    outlives a kill. BlockingIOError where another has it and this one does not wait."""
    file.parent.mkdir(parents=True, exist_ok=True)
    with file.open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX if waits else fcntl.LOCK_EX | fcntl.LOCK_NB)
        yield


def sealed(content: bytes, name: str = "") -> bytes:
    """The content, and after it the SHA-256 of a name and of it, for ``unsealed``: most formats do not tell that a byte
    of theirs has changed."""
    return content + hashlib.sha256(name.encode() + content).digest()


def unsealed(content: bytes, name: str = "") -> bytes | None:
    """What was ``sealed`` under a name; None where it is not as it was."""
    return content[:-SEAL] if sealed(content[:-SEAL], name) == content else None


def file_name(text: str) -> str:
    """A label or item as a file name in any folder; different texts get different names.

    Anything but letters, digits, dot, dash and underscore becomes ``_``, and a changed name gets a part of its hash.
    """
    name = re.sub(r"[^A-Za-z0-9._-]", "_", text).lstrip(".")[:100]
    return name if name and name == text else f"{name}-{digest(text)[:8]}"


def write_png(path: Path, levels: Tensor, bits: int, lasting: bool = True) -> None:
    """Write integer levels ``(C, h, w)``, C = 1 or 3 (red, green, blue), as a PNG of 8 or 16 bits; see
    ``write_atomically``."""
    import cv2
    import numpy as np

    kind = np.uint8 if bits == 8 else np.uint16
    picture = np.ascontiguousarray(levels.flip(0).permute(1, 2, 0).numpy().astype(kind))  # OpenCV: blue first
    encoded, buffer = cv2.imencode(".png", picture)
    if not encoded:
        raise OSError(f"{path}: a picture of the shape {tuple(levels.shape)} cannot be written as PNG")
    write_atomically(path, buffer.tobytes(), lasting)
