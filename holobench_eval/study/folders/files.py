"""The folders of ``holoeval score``: every picture is checked before anything is computed."""

from __future__ import annotations

import os
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from ...core.errors import UserError, listed, suggest
from ...imaging.align import PLAIN, RESIZE
from ...lab.counts import NUMBERS, RAW_SUFFIXES
from ...lab.dark import Dark
from .exposure import NAMES
from .pairing import SAVE_TARGET, Pairing, lit, paired
from .pictures import SUFFIXES, Picture, checked

CAPTURE_SUFFIXES = (*SUFFIXES, NUMBERS, *RAW_SUFFIXES)
NAMED = 3
TOLD = 24  # faults that a line tells, those of a folder of two methods

Key = tuple[str, str]  # method and name of the target
AT_TARGET = (PLAIN, RESIZE, SAVE_TARGET)
IN_FILE = ("; save the", "; expected")  # what a refusal says where a file has to be saved otherwise
Hole = tuple[str, str, str, str]  # state, method, target, reason


@dataclass(frozen=True)
class Folders:
    """The pictures to score.

    targets: by name; captures: by method and name of the target; unread: why others cannot be scored; pairings: how
    each capture is compared with its target; notes: sentences that a reader of the scores needs.
    """

    targets: Mapping[str, Picture]
    captures: Mapping[Key, Picture]
    unread: Mapping[Key, str]
    pairings: Mapping[Key, Pairing]
    notes: tuple[str, ...]

    @cached_property
    def methods(self) -> tuple[str, ...]:
        """The methods, by name."""
        return tuple(sorted({method for method, _ in (*self.captures, *self.unread)}))


def read_folders(captures: Path, targets: Path, linear: bool = False, dark: Dark | None = None) -> Folders:
    """Look at ``captures/<method>/<target>.png`` and ``targets/<target>.png``.

    linear: captures are linear in light; dark: their counts without light. A capture that cannot be read, or that has
    other values, is ``unread``. UserError, one line, for folders that are missing or empty, captures without a target
    of their name and files in the wrong place, targets that cannot be used, and where no capture can be read.
    """
    target_paths = {path.stem: path for path in _pictures(targets, targets, "a target of each scene, <target>.png")}
    capture_paths = dict[Key, Path]()
    for folder in _methods(captures):
        expected = f"a capture of each target, <target>.png{_deeper(folder)}"
        capture_paths |= {
            (folder.name, path.stem): path for path in _pictures(folder, captures, expected, CAPTURE_SUFFIXES)
        }
    alone = [
        f"{path}: no target of this name in {targets}; "
        + (_twice(path, target_paths.values()) or f"{suggest(name, target_paths)}; rename it or take it away")
        for (_, name), path in capture_paths.items()
        if name not in target_paths
    ]
    pictures, wrong = _read(target_paths, _target)
    photographs, unread = _read(capture_paths, lambda path: _capture(path, linear, dark))
    if alone or wrong or not photographs:
        _refuse([*alone, *wrong.values(), *unread.values()])
    pairings = {key: paired(picture, pictures[key[1]]) for key, picture in photographs.items()}
    return Folders(pictures, photographs, unread, pairings, tuple(_notes(pictures, photographs, pairings)))


def _read(paths: Mapping[Any, Path], read: Callable[[Path], Picture]) -> tuple[dict[Any, Picture], dict[Any, str]]:
    """The pictures that can be read, and why others cannot."""
    pictures, faults = {}, {}
    for name, path in paths.items():
        try:
            pictures[name] = read(path)
        except UserError as error:
            faults[name] = str(error)
    return pictures, faults


def _target(path: Path) -> Picture:
    picture = checked(path)
    if picture.is_linear:
        raise UserError(f"{path}: floating point; expected a target in sRGB, of 8 or 16 bits")
    if not lit(picture):
        raise UserError(f"{path}: black; expected a target with light in at least one of its colours")
    return picture


def _capture(path: Path, linear: bool, dark: Dark | None) -> Picture:
    picture = checked(path, linear, dark)
    if linear and picture.is_lossy:
        raise UserError(f"{path}: compressed with loss, no linear light; expected --values stored or srgb")
    if not linear and picture.is_linear:
        raise UserError(f"{path}: RAW files and floating point hold linear light; expected --values linear")
    return picture


def _refuse(faults: Sequence[str]) -> None:
    """UserError, one line, that tells several faults, if there are any."""
    if faults:
        raise UserError("; ".join([*faults[:TOLD], *[f"and {len(faults) - TOLD} more"] * (len(faults) > TOLD)]))


def _twice(capture: Path, targets: Iterable[Path]) -> str:
    """What to rename where an ending stands twice in the name of a capture or of its target, as in my.png.png."""
    for target in targets:
        for longer, other in ((capture, target), (target, capture)):
            if longer.stem == other.name:
                return f"an ending stands twice in the name of {longer}; rename it {other.stem}{longer.suffix}"
    return ""


def _methods(captures: Path) -> list[Path]:
    paths = _listed(captures, "folders of captures, <method>/<target>.png")
    folders = [path for path in paths if path.is_dir() and not path.name.startswith("__")]
    loose = next((path for path in paths if path.is_file()), None)
    if loose is not None:
        raise UserError(f"{loose}: a picture outside a method's folder; expected <method>/<target>.png")
    if not folders:
        raise UserError(f"{captures}: no folders in it; expected one for each method, <method>/<target>.png")
    return folders


def _deeper(folder: Path) -> str:
    """What to give where a folder of captures holds folders, as those of ``holoeval solve`` do."""
    name = next((path.name for path in sorted(folder.iterdir()) if path.is_dir()), "")
    return f", or --captures {folder} for those in its folder {name}" if name else ""


def _pictures(folder: Path, root: Path, what: str, suffixes: tuple[str, ...] = SUFFIXES) -> list[Path]:
    """The pictures in a folder by name, none of them twice and none outside ``root``."""
    paths = [path for path in _listed(folder, what) if path.suffix.lower() in suffixes]
    if not paths:
        raise UserError(f"{folder}: no pictures in it ({', '.join(suffixes)}); expected {what}")
    stems, faults = [path.stem for path in paths], []
    for path in paths:
        if not Path(os.path.realpath(path)).is_relative_to(os.path.realpath(root)):  # resolve() trips over a loop
            faults.append(f"{path}: leads out of the folder {root}; put the picture itself there")
        elif stems.count(path.stem) > 1:
            faults.append(f"{path}: there is another picture named '{path.stem}' in this folder; keep one of them")
    _refuse(faults)
    return paths


def _listed(folder: Path, what: str) -> list[Path]:
    """The pictures and folders in a folder, by name, but for what is hidden or not whole yet."""
    if not folder.is_dir():
        raise UserError(f"{folder}: {'not a folder' if folder.exists() else 'no such folder'}; expected {what}")
    shown = sorted(path for path in folder.iterdir() if not path.name.startswith("."))
    paths = [path for path in shown if path.suffix.lower() in CAPTURE_SUFFIXES or path.is_dir()]
    for path in paths:
        if not path.name.isprintable():
            raise UserError(f"{folder}: the name {path.name!a} has characters that cannot be printed; rename it")
    return paths


def _notes(
    targets: Mapping[str, Picture], captures: Mapping[Key, Picture], pairings: Mapping[Key, Pairing]
) -> Iterator[str]:
    """Sentences about facts that the scores do not show, and about what of the files is compared."""
    pictures = [*targets.values(), *captures.values()]
    if lossy := [picture.path.name for picture in pictures if picture.is_lossy]:
        yield (
            f"Compressed with loss, and not linear in light: {named(lossy)}. It removes noise and fine detail, "
            "which scores of holograms consist of."
        )
    if unseen := sorted(targets.keys() - {target for _, target in captures}):
        yield f"Without any capture: {named(unseen)}."
    first: dict[str, Key] = {}
    for key, picture in captures.items():
        same = first.setdefault(picture.pixels_sha256, key)
        if same != key:
            yield f"The capture {'/'.join(key)} is the same picture as {'/'.join(same)}: one of them is misplaced."
    if opaque := [picture.path.name for picture in pictures if picture.opaque]:
        yield f"An alpha channel that is opaque everywhere was left out: {named(opaque)}."
    lights = {name: lit(target) for name, target in targets.items() if len(lit(target)) < target.shape[0]}
    if dark := [f"{name} has light in {' and '.join(colours)} alone" for name, colours in lights.items()]:
        yield f"Scored in three colours, where light that the target has not is an error: {named(dark)}."
    alone = "on the {} channel alone, which has nearly all of the light, as of a single laser"
    ways = {name: alone.format(name) for name in NAMES}
    ways["gray"] = "in gray, since the channels of the capture, or of its target, are equal"
    for channel, way in ways.items():
        if scored := ["/".join(key) for key, pairing in pairings.items() if pairing.channel == channel]:
            yield f"Scored {way}: {named(scored)}."


def named(names: list[str]) -> str:
    """The first of several names, and how many more there are."""
    more = len(names) - NAMED
    return f"{listed(names[:NAMED])}{f' and {more} more' if more > 0 else ''}"


def remedies(holes: Iterable[Hole]) -> str:
    """What to do about each kind of hole, in one sentence; empty where there is no hole."""
    kinds = defaultdict[str, list[tuple[str, str]]](list)
    for state, method, target, reason in holes:
        kinds[_kind(state, reason)].append((method, target))
    at_target = list(dict.fromkeys(target for _, target in kinds["target"]))
    in_file = [f"{method}/{target}" for method, target in kinds["file"]]
    plural = "s" * (len(at_target) > 1)
    ways = {
        f"save or choose the target{plural} {named(at_target)} anew, whose fault it is and not the captures', as the "
        "reasons say": at_target,
        f"save {named(in_file)} anew, as the reasons say": in_file,
        "take the failed captures again, or name them by what they show": kinds["photograph"],
        "add the captures that are missing": kinds["missing"],
    }
    found = "; ".join(way for way, whose in ways.items() if whose)
    return f"{found[:1].upper()}{found[1:]}." if found else ""


def _kind(state: str, reason: str) -> str:
    if state == "missing":
        return "missing"
    if any(text in reason for text in AT_TARGET):
        return "target"
    return "file" if any(text in reason for text in IN_FILE) else "photograph"
