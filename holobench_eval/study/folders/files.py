"""The folders of ``holoeval score``: every picture is checked before anything is computed."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ...core.errors import UserError, suggest
from ...core.io import TEMPORARY, decode_levels
from ...datasets.images import PNG_END, opened, read
from ...datasets.images import RIGHT as RIGHT_FOR_DATASETS

SUFFIXES = (".png", ".tif", ".tiff", ".jpg", ".jpeg")
RIGHT = "expected an 8-bit or 16-bit PNG or TIFF, gray or RGB, or a JPEG"
SMALLEST = 32  # pixels a side
WIDEST = 16_384  # pixels a side
NAMED = 3

Values = NDArray[np.float32]


@dataclass(frozen=True)
class Picture:
    """A picture file that was read once and is valid.

    shape: ``(C, h, w)``, C = 1 or 3; sha256: of the file; pixels_sha256: of its values.
    """

    path: Path
    shape: tuple[int, int, int]
    sha256: str
    pixels_sha256: str

    @property
    def is_jpeg(self) -> bool:
        """Whether it was compressed with loss, and is display-encoded."""
        return self.path.suffix.lower() in (".jpg", ".jpeg")

    def load(self) -> Values:
        """Its values ``(C, h, w)`` as stored, over the full scale of 8 or 16 bits. UserError if it was changed."""
        content = read(self.path)
        if hashlib.sha256(content).hexdigest() != self.sha256:
            raise UserError(f"{self.path}: changed while it was being scored; start again")
        return _decoded(content, self.path)


@dataclass(frozen=True)
class Folders:
    """The pictures to score.

    targets: by name; captures: by method and name of the target; notes: sentences that a reader of the scores needs.
    """

    targets: Mapping[str, Picture]
    captures: Mapping[tuple[str, str], Picture]
    notes: tuple[str, ...]

    @cached_property
    def methods(self) -> tuple[str, ...]:
        """The methods, by name."""
        return tuple(sorted({method for method, _ in self.captures}))


def read_folders(captures: Path, targets: Path) -> Folders:
    """Look at ``captures/<method>/<target>.png`` and ``targets/<target>.png``.

    UserError, one line, for folders that are missing or empty, files that are no pictures of the right kind, links that
    lead out of the folder, a capture without a target of its name.
    """
    target_paths = {path.stem: path for path in _pictures(targets, targets, "a target of each scene, <target>.png")}
    folders = _methods(captures)
    capture_paths = {
        (folder.name, path.stem): path
        for folder in folders
        for path in _pictures(folder, captures, "a capture of each target, <target>.png")
    }
    for (_, name), path in capture_paths.items():
        if name not in target_paths:
            raise UserError(f"{path}: no target of this name in {targets}; {suggest(name, target_paths)}")
    pictures = {name: _checked(path) for name, path in target_paths.items()}
    photographs = {key: _checked(path) for key, path in capture_paths.items()}
    return Folders(pictures, photographs, tuple(_notes(pictures, photographs)))


def _methods(captures: Path) -> list[Path]:
    _refuse_no_folder(captures, "folders of captures, <method>/<target>.png")
    folders = sorted(path for path in captures.iterdir() if path.is_dir() and not path.name.startswith((".", "__")))
    loose = sorted(path.name for path in captures.iterdir() if path.suffix.lower() in SUFFIXES and path.is_file())
    if loose:
        raise UserError(f"{captures / loose[0]}: a picture outside a method's folder; expected <method>/<target>.png")
    if not folders:
        raise UserError(f"{captures}: no folders in it; expected one for each method, <method>/<target>.png")
    odd = next((path.name for path in folders if not path.name.isprintable()), None)
    if odd is not None:
        raise UserError(f"{captures}: the folder name {odd!a} has characters that cannot be printed; rename it")
    return folders


def _pictures(folder: Path, root: Path, what: str) -> list[Path]:
    """The pictures in a folder by name, none of them twice and none outside ``root``."""
    _refuse_no_folder(folder, what)
    paths = sorted(
        path
        for path in folder.iterdir()
        if path.suffix.lower() in SUFFIXES and not path.name.startswith((".", TEMPORARY))
    )
    if not paths:
        raise UserError(f"{folder}: no pictures in it ({', '.join(SUFFIXES)}); expected {what}")
    stems = [path.stem for path in paths]
    for path in paths:
        if not path.name.isprintable():
            raise UserError(f"{folder}: the file name {path.name!a} has characters that cannot be printed; rename it")
        if not path.resolve().is_relative_to(root.resolve()):
            raise UserError(f"{path}: leads out of the folder {root}; put the picture itself there")
        if stems.count(path.stem) > 1:
            raise UserError(f"{path}: there is another picture named '{path.stem}' in this folder; keep one of them")
    return paths


def _refuse_no_folder(folder: Path, what: str) -> None:
    if not folder.is_dir():
        raise UserError(f"{folder}: {'not a folder' if folder.exists() else 'no such folder'}; expected {what}")


def _checked(path: Path) -> Picture:
    try:
        content = read(path)
        values = _decoded(content, path)
    except UserError as error:
        raise UserError(str(error).replace(RIGHT_FOR_DATASETS, RIGHT)) from error
    channels, height, width = values.shape
    if min(height, width) < SMALLEST or max(height, width) > WIDEST:
        raise UserError(f"{path}: {width} x {height} pixels; expected sides from {SMALLEST} to {WIDEST} pixels")
    pixels = hashlib.sha256(repr(values.shape).encode() + values.tobytes()).hexdigest()
    return Picture(path, (channels, height, width), hashlib.sha256(content).hexdigest(), pixels)


def _decoded(content: bytes, path: Path) -> Values:
    """``(C, h, w)`` values over full scale; UserError for a file that is damaged or of another kind."""
    image = opened(content, str(path))
    if image.format not in ("PNG", "TIFF", "JPEG"):
        raise UserError(f"{path}: a {image.format} file under another name; {RIGHT}")
    if image.mode not in ("L", "RGB") and not image.mode.startswith("I;16"):
        alpha = "A" in image.mode or "transparency" in image.info
        raise UserError(f"{path}: an image {'with alpha' if alpha else f'of mode {image.mode}'}; {RIGHT}")
    _load(image, content, path)
    pixels = decode_levels(content)
    if pixels is None:
        raise UserError(f"{path}: an image that cannot be decoded; {RIGHT}")
    if pixels.ndim == 3 and pixels.shape[2] != 3:
        raise UserError(f"{path}: {pixels.shape[2]} channels (alpha?); {RIGHT}")
    planes = pixels[None] if pixels.ndim == 2 else pixels.transpose(2, 0, 1)
    full = 255 if pixels.dtype == np.uint8 else 65535
    return np.ascontiguousarray(planes, dtype=np.float32) / np.float32(full)


def _load(image: Image.Image, content: bytes, path: Path) -> None:
    """Decode the file with Pillow, which reports truncated files that OpenCV would pad."""
    if image.format == "PNG" and PNG_END not in content:
        raise UserError(f"{path}: truncated or damaged: the end of the PNG is missing; {RIGHT}")
    try:
        image.load()
    except Exception as error:  # whatever a decoder trips over in a damaged file
        reason = " ".join(str(error).split()) or type(error).__name__
        raise UserError(f"{path}: truncated or damaged: {reason}; {RIGHT}") from error


def _notes(targets: Mapping[str, Picture], captures: Mapping[tuple[str, str], Picture]) -> Iterator[str]:
    """Sentences about facts that the scores do not show."""
    lossy = [picture.path.name for picture in (*targets.values(), *captures.values()) if picture.is_jpeg]
    if lossy:
        yield (
            f"Compressed with loss, and not linear in light: {_named(lossy)}. JPEG removes noise and fine detail, "
            "which scores of holograms consist of."
        )
    unseen = [name for name in targets if not any(name == target for _, target in captures)]
    if unseen:
        yield f"Without any capture: {_named(unseen)}."
    first: dict[str, tuple[str, str]] = {}
    for key, picture in captures.items():
        same = first.setdefault(picture.pixels_sha256, key)
        if same != key:
            yield f"The capture {'/'.join(key)} is the same picture as {'/'.join(same)}: one of them is misplaced."
        if picture.pixels_sha256 in {target.pixels_sha256 for target in targets.values()}:
            yield f"The capture {'/'.join(key)} is a target itself and no photograph."


def _named(names: list[str]) -> str:
    more = len(names) - NAMED
    return f"{', '.join(names[:NAMED])}{f' and {more} more' if more > 0 else ''}"
