"""Which pictures the page holds: all where they fit into its size, else those that answer most, by a stated rule."""

from __future__ import annotations

import io
import itertools
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import TypeVar

from PIL import Image

from ...core.io import write_atomically
from ...study.scoring.pictures import LONGEST_THUMBNAIL
from ..charts.tiles import spread
from ..facts import ORACLE
from ..results import Results
from ..story import Report
from .data import Json

TARGETS_IN_FULL = 4  # targets with the captures of all methods where not all pictures fit

Key = TypeVar("Key")
T = TypeVar("T")
Cell = tuple[str, str, str]  # method, condition, target; a target itself has neither method nor condition
MOST_BYTES = 1_200_000  # of all pictures of a report: thirty reports leave a clone below 60 MB
QUALITY = 75  # of WebP, 0 to 100: two thirds of the bytes of 85, 1 dB further from the capture
MARK, SAYS = "README.md", b"Small copies of the pictures of the report beside this folder, written with it.\n"


def _fitting(
    groups: Iterable[Mapping[Key, Path]], room: int, content: Callable[[Path], T], size: Callable[[T], int]
) -> dict[Key, T]:
    """The contents of groups of files, first things first: what is new of a group comes all or, without room, not."""
    kept = dict[Key, T]()
    for group in groups:
        new = {key: content(path) for key, path in group.items() if key not in kept}
        if (taken := sum(map(size, new.values()))) <= room:
            kept, room = kept | new, room - taken
    return kept


def _base64_length(path: Path) -> int:
    return -(-path.stat().st_size // 3) * 4


def pictures(report: Report, room: int) -> tuple[dict[Cell, bytes], Json]:
    """The pictures that fit into ``room`` bytes of base64, and what the page says of them.

    Where not all fit, first come ``TARGETS_IN_FULL`` targets, evenly spaced from worst to best and those in the middle
    first, with the captures of all methods on every display; then, target by target, the best method, the baseline and
    the oracle on every display; then the same on the changed displays, for the first targets only. A target's pictures
    come all or not.
    """
    everything = files(report)
    some = ({cell: everything[cell] for cell in wanted if cell in everything} for wanted in groups(report))
    chosen = _fitting(itertools.chain([everything], some), room, Path, _base64_length)
    found = {cell: path.read_bytes() for cell, path in chosen.items()}
    return found, {**_numbers(report, found), "note": _note(report, len(found), len(everything))}


def _numbers(report: Report, found: Iterable[Cell]) -> Json:
    results, number = report.results, {cell: index for index, cell in enumerate(found)}.get
    displays = _pictured(results, [*results.conditions, *results.changed])
    targets, held = results.targets, Counter(target for *_, target in found)
    return {
        "targets": {name: [number(("", results.reference(name), target)) for target in targets] for name in displays},
        "cells": {
            name: {label: [number((label, name, target)) for target in targets] for label in results.methods(name)}
            for name in displays
        },
        "first": max(targets, key=lambda target: held[target]),  # the first of those with most pictures
    }


def _note(report: Report, held: int, there: int) -> str:
    text = report.results.text
    sizes = (
        f"Pictures are 8-bit sRGB, pixel for pixel from the records, or the report's WebP copies where these are not "
        f"there; {text.scored}s are registered and matched in intensity, and reduced where the longer side would "
        f"exceed {LONGEST_THUMBNAIL} pixels."
    )
    if not there:
        return f"This page holds no pictures: there were no thumbnails of {text.scored}s when it was written."
    if held == there:
        return f"This page holds all {there} pictures of the study. {sizes}"
    return (
        f"This page holds {held} of {there} pictures, as many as its size allows: all {text.scored}s of up to "
        f"{TARGETS_IN_FULL} targets, evenly spaced from worst to best, and of further targets the best method, the "
        f"baseline and the oracle. {sizes}"
    )


def groups(report: Report) -> Iterator[list[Cell]]:
    """The pictures that answer most, first things first: see ``pictures``."""
    results, conditions = report.results, _pictured(report.results, report.results.conditions)
    if not conditions:
        return
    ranked = report.thumbnails.by_quality(conditions[0])
    first = sorted(spread(ranked, TARGETS_IN_FULL), key=lambda target: abs(ranked.index(target) - len(ranked) // 2))
    for target in first:
        cells = ((label, name, target) for name in conditions for label in results.methods(name))
        yield [*_truths(report, target), *cells]
    for target in results.targets:
        yield [*_truths(report, target), *_roles(report, conditions, target)]
    for target in first:
        yield list(_roles(report, _pictured(results, results.changed), target))


def _truths(report: Report, target: str) -> list[Cell]:
    """The pictures of a target: one, or one for each of those displays that show it differently."""
    pictured = _pictured(report.results, report.results.conditions)
    return [("", reference, target) for reference in dict.fromkeys(map(report.results.reference, pictured))]


def _roles(report: Report, conditions: list[str], target: str) -> Iterator[Cell]:
    """The best method of a display, the baseline and the oracle."""
    results = report.results
    for condition in conditions:
        roles = (
            *results.ranking(condition)[:1],
            results.baseline,
            *results.ranking(condition, categories=(ORACLE,))[:1],
        )
        for label in dict.fromkeys(role for role in roles if role in results.methods(condition)):
            yield str(label), condition, target


def _pictured(results: Results, conditions: Iterable[str]) -> list[str]:
    return [name for name in conditions if results.has_pictures(name)]


def files(report: Report) -> dict[Cell, Path]:
    """The files of targets and captures that are there: of a capture that of the first repeat with a score."""
    results, thumbnails = report.results, report.thumbnails
    shown = results.done[results.done["condition"].isin(_pictured(results, [*results.conditions, *results.changed]))]
    cells = shown.drop_duplicates(["label", "condition", "target"])[["label", "condition", "target", "cell"]]
    paths = {(label, name, target): thumbnails.of_capture(cell) for label, name, target, cell in cells.to_numpy()}
    truths = (cell for target in results.targets for cell in _truths(report, target))
    targets = {cell: thumbnails.of_target(cell[2], results.shape(cell[1])) for cell in truths}
    return {cell: path for cell, path in (targets | paths).items() if path.is_file()}


def keep_copies(report: Report) -> None:
    """Copy the thumbnails that answer most into ``pictures``, as WebP; those of an earlier run go.

    Nothing changes where a report is written again without its records, nor in a folder that is somebody else's.
    """
    folder = report.thumbnails.copies
    is_ours = not folder.exists() or ((folder / MARK).is_file() and (folder / MARK).read_bytes() == SAYS)
    if not report.thumbnails.store.folder.is_dir() or not is_ours:
        return
    known = files(report)
    by_target = ([cell for cell in known if cell[2] == target] for target in report.results.targets)
    wanted = (
        {known[cell].stem: known[cell] for cell in group if cell in known} for group in [*groups(report), *by_target]
    )
    kept = {stem: content for stem, content in _fitting(wanted, MOST_BYTES, _encoded, len).items() if content}
    if kept:
        write_atomically(folder / MARK, SAYS)
    for old in folder.glob("*.webp"):
        if old.stem not in kept:
            old.unlink()
    for stem, content in kept.items():
        write_atomically(folder / f"{stem}.webp", content)


def _encoded(path: Path) -> bytes:
    """A picture as WebP; a copy as it is, and nothing of a damaged file."""
    if path.suffix == ".webp":
        return path.read_bytes()
    encoded = io.BytesIO()
    try:
        with Image.open(path) as picture:
            picture.save(encoded, "WEBP", quality=QUALITY, method=6)
    except (OSError, ValueError, Image.DecompressionBombError):
        return b""
    return encoded.getvalue()
