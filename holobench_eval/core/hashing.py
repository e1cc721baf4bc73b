"""Plain descriptions and files, and the hashes that name what they hold."""

from __future__ import annotations

import hashlib
import json
import stat
from functools import lru_cache
from pathlib import Path
from typing import Any

from .errors import UserError

ABSENT = "absent"  # in place of the digest of a file that is not there

State = tuple[int, int, int, int]
"""What changes with a file's content: its inode, its size, and the times of its last changes [ns]."""


def canonical(description: Any) -> str:
    """JSON text that depends on the content only: sorted keys, no spaces, ASCII, finite numbers."""
    try:
        return json.dumps(description, sort_keys=True, separators=(",", ":"), ensure_ascii=True, allow_nan=False)
    except (TypeError, ValueError) as error:
        raise UserError(f"not a plain description: {error}; use text, finite numbers, lists and mappings") from error


def digest(description: Any) -> str:
    """sha256 of the canonical text, 64 hexadecimal digits."""
    return hashlib.sha256(canonical(description).encode()).hexdigest()


def file_state(path: str | Path) -> State | None:
    """The state of a regular file; None for anything else."""
    try:
        found = Path(path).stat()
    except (OSError, ValueError):
        return None
    if not stat.S_ISREG(found.st_mode):
        return None
    return found.st_ino, found.st_size, found.st_mtime_ns, found.st_ctime_ns


def file_digest(path: str | Path) -> str:
    """sha256 of a file, ``absent`` for none that can be read. A file that stays as it is, is read once."""
    path = Path(path)
    state = file_state(path)
    try:
        return ABSENT if state is None else _file_digest(path.absolute(), state)
    except OSError:
        return ABSENT


@lru_cache(maxsize=2**16)
def _file_digest(path: Path, _state: State) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
