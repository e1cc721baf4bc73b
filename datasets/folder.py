"""A folder of one's own images, optionally pinned by a manifest of SHA-256 sums."""

from __future__ import annotations

import hashlib
import re
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path, PurePosixPath
from typing import Annotated, ClassVar

from annotated_types import Interval, MinLen
from torch import Tensor

from ..core.errors import UserError, suggest
from ..core.hashing import State, file_state
from ..core.io import read_text
from .base import fit, looked_from, with_channels
from .images import RIGHT, SUFFIXES, GrayImageError, SixteenBit, decode, read

LARGEST_MANIFEST = 10_000_000  # bytes; a hundred thousand lines

NAMED = 5  # gray images that a message names

_MANIFEST_LINE = re.compile(r"([0-9a-fA-F]{64}) [ *](.+)")


@dataclass(frozen=True)
class Folder:
    """The images in a folder: DIV2K, Kodak, or one's own.

    path: the folder, from the working directory where relative. Its images are taken in the order of their names;
    other files, hidden files and subfolders are left alone. A link that leads out of the folder is refused.
    manifest: a file as ``sha256sum *.png > SHA256SUMS`` writes it, from the working directory where relative. Only the
    files it lists are taken then, they may lie in subfolders, and each must have the sum given for it.
    count: the first so many; null for all. gray: take one-channel images, replicated. sixteen_bit: take 16-bit PNG
    and TIFF, as ``srgb`` levels or as ``linear`` light.

    Every image must be an 8-bit RGB image in sRGB unless these say otherwise. All are decoded before a study begins,
    once for as long as their size and time of change stay the same.

    The validation set of DIV2K (Agustsson & Timofte, "NTIRE 2017 challenge on single image super-resolution",
    CVPR Workshops 2017; for academic research only) is ``DIV2K_valid_HR.zip`` at https://data.vision.ee.ethz.ch/cvl/DIV2K/.
    Unpack it and write::

        targets: {dataset: folder, params: {path: data/DIV2K_valid_HR, count: 24}}
    """

    path: Annotated[str, MinLen(1)]
    manifest: str | None = None
    count: Annotated[int, Interval(ge=1)] | None = None
    gray: bool = False
    sixteen_bit: SixteenBit = "refuse"

    training: ClassVar[bool] = False

    def items(self) -> list[str]:
        """Paths within the folder, in order; UserError for an image that is missing, changed, damaged or not RGB."""
        names = sorted(self._sums() or self._listed())[: self.count]
        gray = []
        for name in names:
            try:
                self.digest(name)
            except GrayImageError:
                gray.append(name)
        if gray:
            some = f"{', '.join(gray[:NAMED])}{f' and {len(gray) - NAMED} more' if len(gray) > NAMED else ''}"
            raise UserError(
                f"{self.path}: {len(gray)} of {len(names)} images have one channel ({some}); {RIGHT}, or gray: true in "
                "params, which takes gray images too, replicated to three channels"
            )
        return names

    def load(self, item: str, shape: tuple[int, int], channels: int = 3) -> Tensor:
        """An image as ``(channels, *shape)`` linear light in [0, 1], cropped and resized by ``base.fit``."""
        path = self._file(item)
        content = read(path)
        self._compare(item, hashlib.sha256(content).hexdigest())
        return with_channels(fit(decode(content, str(path), self.gray, self.sixteen_bit), shape), channels)

    def digest(self, item: str) -> str:
        """SHA-256 of the file, which is decoded to make sure that it can be."""
        path = self._file(item)
        digest = _checked(path, file_state(path), self.gray, self.sixteen_bit)
        self._compare(item, digest)
        return digest

    def _root(self) -> Path:
        root = Path(self.path)
        if not root.is_dir():
            what = "not a folder" if root.exists() else f"no such folder{looked_from(root)}"
            raise UserError(f"{root}: {what}; dataset 'folder' needs a folder of images as path")
        return root

    def _listed(self) -> list[str]:
        """The images that lie directly in the folder."""
        root = self._root()
        try:
            names = [file.name for file in root.iterdir() if _is_image(file.name) and not file.is_dir()]
        except OSError as error:
            raise UserError(f"{root}: cannot be read: {error.strerror}") from error
        if not names:
            raise UserError(f"{root}: no images in this folder; expected files ending in {', '.join(sorted(SUFFIXES))}")
        odd = next((name for name in names if not name.isprintable()), None)
        if odd is not None:
            raise UserError(f"{root}: the file name {odd!a} has characters that cannot be printed; rename it")
        return names

    def _sums(self) -> dict[str, str]:
        """Name and SHA-256 of every line of the manifest; empty without one."""
        if self.manifest is None:
            return {}
        path = Path(self.manifest)
        if not path.is_file():
            raise UserError(
                f"{path}: no such manifest{looked_from(path)}; write one with: sha256sum *.png > SHA256SUMS"
            )
        return _manifest(path, file_state(path))

    def _file(self, item: str) -> Path:
        """The path of an item that exists, is listed and lies inside the folder, links followed."""
        root = self._root()
        sums = self._sums()
        if sums and item not in sums:
            raise UserError(f"{self.manifest}: no line for '{item}'; {suggest(item, list(sums)[:20])}")
        if not sums and (PurePosixPath(item).name != item or not _is_image(item)):
            raise UserError(f"{root}: '{item}' is not the name of an image in this folder")
        path = root / item
        if not path.is_file():
            what = "not a regular file" if path.exists() else "no such file"
            listed = f", but {self.manifest} lists it" if sums else ""
            raise UserError(f"{path}: {what}{listed}")
        if not path.resolve().is_relative_to(root.resolve()):
            raise UserError(f"{path}: leads out of the folder {root}; put the image itself there")
        return path

    def _compare(self, item: str, digest: str) -> None:
        wanted = self._sums().get(item, digest)
        if digest != wanted:
            raise UserError(
                f"{Path(self.path) / item}: SHA-256 is {digest[:12]}..., {self.manifest} says {wanted[:12]}...; "
                "the file has changed: restore it, or write the manifest anew"
            )


def _is_image(name: str) -> bool:
    return not name.startswith(".") and PurePosixPath(name).suffix.lower() in SUFFIXES


@lru_cache(maxsize=4096)
def _checked(path: Path, _state: State | None, gray: bool, sixteen_bit: SixteenBit) -> str:
    """SHA-256 of a file that can be decoded; remembered for this state of the file."""
    content = read(path)
    decode(content, str(path), gray, sixteen_bit)
    return hashlib.sha256(content).hexdigest()


@lru_cache(maxsize=16)
def _manifest(path: Path, _state: State | None) -> dict[str, str]:
    """Name and sum of every line; UserError for a line of another form and for a path that leaves its folder."""
    try:
        lines = read_text(path, LARGEST_MANIFEST).split("\n")
    except OSError as error:
        raise UserError(f"{path}: cannot be read: {error.strerror}") from error
    sums: dict[str, str] = {}
    for number, line in enumerate(lines, start=1):
        if not line.strip():
            continue
        parts = _MANIFEST_LINE.fullmatch(line)
        if parts is None:
            raise UserError(
                f"{path}:{number}: not a line of sha256sum; expected 64 hexadecimal digits, two spaces, a path"
            )
        name = str(PurePosixPath(parts[2]))
        if PurePosixPath(name).is_absolute() or ".." in PurePosixPath(name).parts:
            raise UserError(f"{path}:{number}: '{name[:80]}' leaves the folder; expected a path inside it")
        if not name.isprintable() or "\\" in name:
            raise UserError(f"{path}:{number}: the file name {name[:80]!a} cannot be used; expected plain characters")
        if name in sums:
            raise UserError(f"{path}:{number}: '{name[:80]}' is listed twice")
        sums[name] = parts[1].lower()
    if not sums:
        raise UserError(f"{path}: the manifest is empty; write one with: sha256sum *.png > SHA256SUMS")
    return sums
