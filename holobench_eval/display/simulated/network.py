"""A learned predictor of captures as a display: the network file of a profile, in the place of all stages."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

from annotated_types import Interval

from .maps import described, inside

LARGEST = 100_000_000  # bytes of a file: all methods of this package on a panel of 1080 x 1920


@dataclass(frozen=True)
class NetworkFile:
    """What a method has learned of a display, and predicts captures with.

    method: that has learned it, by its name in configs, null for a profile that has stages; version: of the method's
    code; params: of the method; file: what it has learned, in the folder of the profile or below it; size: of the file,
    at most 100 MB [bytes]; sha256: of the file, 64 hexadecimal digits.
    """

    method: str | None = None
    version: str | None = None
    params: Mapping[str, Any] = field(default_factory=dict)
    file: str | None = None
    size: Annotated[int, Interval(ge=0, le=LARGEST)] = 0
    sha256: str | None = None

    def found(self, folder: Path) -> Path:
        """The file's path; folder: of the profile. UserError: it is elsewhere, or another than the profile says."""
        path = inside(self.file or "", folder)
        self.content(path)
        return path

    def content(self, path: Path) -> bytes:
        """The file's bytes. UserError: it cannot be read, or is another than the profile says."""
        return described(path, LARGEST, self.size, self.sha256)
