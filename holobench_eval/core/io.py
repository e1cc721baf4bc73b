"""Files: written whole or not at all, under names that any folder takes, dated alike."""

from __future__ import annotations

import os
import re
import tempfile
from datetime import UTC, datetime
from pathlib import Path

import cv2
import numpy as np
from torch import Tensor

from .hashing import digest

TEMPORARY = ".writing-"
"""How the name of a file begins that is not whole yet."""


def now() -> str:
    """The present time, UTC, to the second."""
    return datetime.now(UTC).isoformat(timespec="seconds")


def write_atomically(path: Path, content: bytes) -> None:
    """Write a file under a temporary name in the same folder, then rename it: readers see all of it or nothing."""
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(prefix=TEMPORARY, dir=path.parent)
    temporary = Path(name)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        temporary.chmod(0o644)
        temporary.replace(path)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def file_name(text: str) -> str:
    """A label or item as a file name in any folder; different texts get different names.

    Anything but letters, digits, dot, dash and underscore becomes ``_``, and a changed name gets a part of its hash.
    """
    name = re.sub(r"[^A-Za-z0-9._-]", "_", text).lstrip(".")[:100]
    return name if name and name == text else f"{name}-{digest(text)[:8]}"


def write_png(path: Path, levels: Tensor, bits: int) -> None:
    """Write integer levels ``(C, h, w)``, C = 1 or 3 (red, green, blue), as a PNG of 8 or 16 bits."""
    kind = np.uint8 if bits == 8 else np.uint16
    picture = np.ascontiguousarray(levels.flip(0).permute(1, 2, 0).numpy().astype(kind))  # OpenCV: blue first
    encoded, buffer = cv2.imencode(".png", picture)
    if not encoded:
        raise OSError(f"{path}: a picture of the shape {tuple(levels.shape)} cannot be written as PNG")
    write_atomically(path, buffer.tobytes())
