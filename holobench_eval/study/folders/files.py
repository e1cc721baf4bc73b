"""The folders of ``holoeval score``: every picture is checked before anything is computed."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from ...core.errors import UserError, suggest
from ...core.io import TEMPORARY
from .exposure import NAMES
from .pairing import Pairing, paired
from .pictures import RAW_SUFFIXES, SUFFIXES, Picture, checked

CAPTURE_SUFFIXES = (*SUFFIXES, *RAW_SUFFIXES)
NAMED = 3

Key = tuple[str, str]  # method and name of the target


@dataclass(frozen=True)
class Folders:
    """The pictures to score.

    targets: by name; captures: by method and name of the target; pairings: how each capture is compared with its
    target; notes: sentences that a reader of the scores needs.
    """

    targets: Mapping[str, Picture]
    captures: Mapping[Key, Picture]
    pairings: Mapping[Key, Pairing]
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
        for path in _pictures(folder, captures, "a capture of each target, <target>.png", CAPTURE_SUFFIXES)
    }
    for (_, name), path in capture_paths.items():
        if name not in target_paths:
            twice = _twice(path, target_paths.values())
            right = twice or f"{suggest(name, target_paths)}; rename it or take it away"
            raise UserError(f"{path}: no target of this name in {targets}; {right}")
    pictures = {name: checked(path) for name, path in target_paths.items()}
    photographs = {key: checked(path) for key, path in capture_paths.items()}
    pairings = {key: paired(picture, pictures[key[1]]) for key, picture in photographs.items()}
    notes = (*_notes(pictures, photographs), *_conversions(pictures, photographs, pairings))
    return Folders(pictures, photographs, pairings, notes)


def _twice(capture: Path, targets: Iterable[Path]) -> str:
    """What to rename where a capture and a target differ by an ending that stands there twice, as in my.png.png."""
    for target in targets:
        if _bare(target) == _bare(capture):
            longer = max(capture, target, key=lambda path: len(path.stem))
            return f"an ending stands twice in the name of {longer}; rename it {_bare(longer)}{longer.suffix}"
    return ""


def _bare(path: Path) -> str:
    """A file's name without all endings of pictures."""
    while path.suffix.lower() in CAPTURE_SUFFIXES:
        path = path.with_suffix("")
    return path.name


def _methods(captures: Path) -> list[Path]:
    _refuse_no_folder(captures, "folders of captures, <method>/<target>.png")
    folders = sorted(path for path in captures.iterdir() if path.is_dir() and not path.name.startswith((".", "__")))
    pictures = (path for path in captures.iterdir() if path.suffix.lower() in CAPTURE_SUFFIXES and path.is_file())
    loose = sorted(path.name for path in pictures)
    if loose:
        raise UserError(f"{captures / loose[0]}: a picture outside a method's folder; expected <method>/<target>.png")
    if not folders:
        raise UserError(f"{captures}: no folders in it; expected one for each method, <method>/<target>.png")
    odd = next((path.name for path in folders if not path.name.isprintable()), None)
    if odd is not None:
        raise UserError(f"{captures}: the folder name {odd!a} has characters that cannot be printed; rename it")
    return folders


def _pictures(folder: Path, root: Path, what: str, suffixes: tuple[str, ...] = SUFFIXES) -> list[Path]:
    """The pictures in a folder by name, none of them twice and none outside ``root``."""
    _refuse_no_folder(folder, what)
    paths = sorted(
        path
        for path in folder.iterdir()
        if path.suffix.lower() in suffixes and not path.name.startswith((".", TEMPORARY))
    )
    if not paths:
        raise UserError(f"{folder}: no pictures in it ({', '.join(suffixes)}); expected {what}")
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


def _notes(targets: Mapping[str, Picture], captures: Mapping[Key, Picture]) -> Iterator[str]:
    """Sentences about facts that the scores do not show."""
    lossy = [picture.path.name for picture in (*targets.values(), *captures.values()) if picture.is_lossy]
    if lossy:
        yield (
            f"Compressed with loss, and not linear in light: {named(lossy)}. It removes noise and fine detail, "
            "which scores of holograms consist of."
        )
    unseen = [name for name in targets if not any(name == target for _, target in captures)]
    if unseen:
        yield f"Without any capture: {named(unseen)}."
    first: dict[str, Key] = {}
    for key, picture in captures.items():
        same = first.setdefault(picture.pixels_sha256, key)
        if same != key:
            yield f"The capture {'/'.join(key)} is the same picture as {'/'.join(same)}: one of them is misplaced."


def _conversions(
    targets: Mapping[str, Picture], captures: Mapping[Key, Picture], pairings: Mapping[Key, Pairing]
) -> Iterator[str]:
    """Sentences about what of the files is compared, where that is not all of it."""
    opaque = [picture.path.name for picture in (*targets.values(), *captures.values()) if picture.opaque]
    if opaque:
        yield f"An alpha channel that is opaque everywhere was left out: {named(opaque)}."
    for channel in NAMES:
        alone = _labels(key for key, pairing in pairings.items() if pairing.channel == channel)
        if alone:
            yield (
                f"Scored on the {channel} channel alone, which has nearly all of the light, as of a single laser: "
                f"{named(alone)}."
            )
    gray = _labels(key for key, pairing in pairings.items() if pairing.channel == "gray")
    if gray:
        yield f"Scored in gray, since the channels of the capture, or of its target, are equal: {named(gray)}."


def _labels(keys: Iterable[Key]) -> list[str]:
    return ["/".join(key) for key in keys]


def named(names: list[str]) -> str:
    """The first of several names, and how many more there are."""
    more = len(names) - NAMED
    return f"{', '.join(names[:NAMED])}{f' and {more} more' if more > 0 else ''}"
