"""Everything that can be wrong with a series of photographs, looked for before any of them is scored."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from .frames import Facts
from .manifest import DARK, HOLOGRAM, Pattern

DEPTHS = (8, 10, 12, 14, 16)
MOST_SATURATED = 0.001
"""Fraction of saturated samples with which a photograph is scored (protocol v1, step 1)."""
BRIGHTEST_DARK = 0.2
"""Of the mean of the other photographs: a dark frame as bright as this was taken with the laser on."""
SHOWN = 5
"""Faults of one kind that are named."""
THUMBNAIL = 96
"""Pixels of the longer side of the small pictures that tell which hologram a photograph shows."""
CLEARLY = 0.1
"""By how much another pattern's picture has to be more like a photograph than its own, in correlation."""


@dataclass(frozen=True)
class Series:
    """The photographs of a round that can be used.

    white: counts from which a sample is saturated; saturated: fraction of such samples by capture name; notes: what a
    reader of the scores should know, a line each.
    """

    white: float
    saturated: Mapping[str, float]
    notes: tuple[str, ...]


def check_present(folder: Path, patterns: Sequence[Pattern], found: Mapping[str, Path | None]) -> list[str]:
    """Faults: photographs that are not there; found: the file of every capture, by its name."""
    missing = [pattern.capture for pattern in patterns if found[pattern.capture] is None]
    if len(missing) == len(patterns):
        return [f"none of the {len(missing)} photographs is in {folder / Path(missing[0]).parent}"]
    return _told(missing, "missing: {} (.png, .tif or the camera's RAW)")


def check_series(patterns: Sequence[Pattern], facts: Mapping[str, Facts]) -> tuple[Series, list[str]]:
    """What the photographs of a round have in common, and the faults of single ones, a line each.

    facts: by the name of a pattern's capture, complete.
    """
    shown = [(pattern, facts[pattern.capture]) for pattern in patterns]
    white, notes = _white([frame for _, frame in shown])
    faults = _sizes(shown) or [*_repeated(shown), *_dark(shown)]
    shares: dict[str, float] = {}
    for pattern, frame in shown:
        shares[pattern.capture] = share = frame.at_highest if frame.highest >= white else 0.0
        if share > MOST_SATURATED and pattern.role != DARK:
            faults.append(
                f"saturated: {share:.2%} of {pattern.capture} is at {white:g} counts, more than {MOST_SATURATED:.1%}; "
                "shorten the session's exposure and photograph all patterns again"
            )
    if not all(frame.linear for _, frame in shown):
        notes.append("photographs are JPEG, decoded as sRGB: not linear in light, so that scores are indicative only")
    return Series(white, shares, tuple(notes)), _shortened(faults)


def _white(frames: Sequence[Facts]) -> tuple[float, list[str]]:
    """Counts of a saturated sample: of the fewest bits that hold every photograph, wherever in 16 they lie."""
    highest = max(frame.highest for frame in frames)
    top, step = frames[0].top, min(frame.step for frame in frames)
    if top not in (255.0, 65535.0):
        return top, []
    if top == 65535.0 and step >= 4:
        bits = 16 - int(np.log2(step))
        return top - step + 1, [f"photographs have {bits} bits at the upper end of 16: steps of {step} counts"]
    bits = next(depth for depth in DEPTHS if highest <= 2**depth - 1)
    notes = [f"photographs have {bits} bits at the lower end of 16"] if top == 65535.0 and bits < 16 else []
    return float(2**bits - 1), notes


def _sizes(shown: Sequence[tuple[Pattern, Facts]]) -> list[str]:
    """Photographs of another size than most."""
    shapes = [frame.shape for _, frame in shown]
    usual = max(set(shapes), key=shapes.count)
    odd = [f"{pattern.capture} has {frame.shape}" for pattern, frame in shown if frame.shape != usual]
    return _told(odd, f"wrong size: {{}}, most have {usual} pixels")


def _repeated(shown: Sequence[tuple[Pattern, Facts]]) -> list[str]:
    """Files with the same bytes: noise alone makes two photographs differ."""
    faults, first = [], dict[str, Pattern]()
    for pattern, frame in shown:
        before = first.setdefault(frame.sha256, pattern)
        if before is pattern:
            continue
        if before.number + 1 == pattern.number:
            faults.append(f"stale frame: {pattern.capture} is {before.capture} again; the camera gave an old frame")
        else:
            faults.append(f"duplicated: {pattern.capture} and {before.capture} are the same file")
    return faults


def _dark(shown: Sequence[tuple[Pattern, Facts]]) -> list[str]:
    """Dark frames that are not dark, and bright ones that are no brighter than those."""
    dark = [frame.mean for pattern, frame in shown if pattern.role == DARK]
    bright = [frame.mean for pattern, frame in shown if pattern.role != DARK]
    if not dark or not bright:
        return []
    light = float(np.median(bright)) - min(dark)
    if light <= 0:
        return ["no light: the photographs of holograms are no brighter than the dark frames"]
    odd = [
        f"{pattern.capture}"
        for pattern, frame in shown
        if pattern.role == DARK and frame.mean - min(dark) > BRIGHTEST_DARK * light
    ]
    return _told(odd, "wrong order: {} should be dark; is the laser blocked, and the order that of order.csv?")


def check_order(
    patterns: Sequence[Pattern], seen: Mapping[str, NDArray[np.float32]], wanted: Mapping[str, NDArray[np.float32]]
) -> list[str]:
    """Faults: photographs that show another hologram of their round than their name says.

    seen: registered photographs ``(h, w)`` by name; wanted: what the nominal optics predict for each. Holograms of one
    picture look alike whoever made them, so this finds photographs of another *picture*.
    """
    holograms = [pattern for pattern in patterns if pattern.role == HOLOGRAM and pattern.capture in seen]
    faults = []
    for colour in sorted({pattern.colour for pattern in holograms}):
        same = [pattern for pattern in holograms if pattern.colour == colour]
        expected, found = (_normalised([pictures[one.capture] for one in same]) for pictures in (wanted, seen))
        likeness = expected @ found.T
        for index, pattern in enumerate(same):
            best = int(likeness[:, index].argmax())
            if likeness[best, index] > likeness[index, index] + CLEARLY:
                faults.append(f"wrong order: {pattern.capture} shows pattern {same[best].number:04d}")
    return _shortened(faults)


def _normalised(pictures: Sequence[NDArray[np.float32]]) -> NDArray[np.float64]:
    """Small pictures of square-root light as rows of zero mean and length one."""
    rows = []
    for picture in pictures:
        shrink = max(1.0, max(picture.shape) / THUMBNAIL)
        size = (max(1, round(picture.shape[1] / shrink)), max(1, round(picture.shape[0] / shrink)))
        small = cv2.resize(np.sqrt(np.maximum(picture, 0)), size, interpolation=cv2.INTER_AREA)
        row = np.asarray(small, dtype=np.float64).ravel() - float(small.mean())
        rows.append(row / max(float(np.linalg.norm(row)), 1e-12))
    return np.stack(rows)


def _told(names: Sequence[str], line: str) -> list[str]:
    """One line for many names."""
    if not names:
        return []
    more = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
    return [line.format(", ".join(names[:SHOWN]) + more)]


def _shortened(faults: Sequence[str]) -> list[str]:
    """The first faults of every kind, and how many more there are."""
    kinds: dict[str, list[str]] = {}
    for fault in faults:
        kinds.setdefault(fault.partition(":")[0], []).append(fault)
    told = []
    for kind, lines in kinds.items():
        told += lines[:SHOWN]
        if len(lines) > SHOWN:
            told.append(f"{kind}: {len(lines) - SHOWN} more")
    return told
