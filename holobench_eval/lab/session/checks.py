"""Everything that can be wrong with a series of photographs, looked for before any of them is scored."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from ..photograph import MOST_SATURATED
from .frames import Facts
from .manifest import DARK, HOLOGRAM, Pattern

DEPTHS = (8, 10, 12, 14, 16)
DIM = 0.4
"""Of the camera's range: a series whose brightest sample stays below is told to be exposed too short."""
EIGHT_BITS = 255.0
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
    faults = _kinds(shown) or _sizes(shown) or [*_repeated(shown), *_dark(shown)]
    white, notes = _white([frame for _, frame in shown])
    shares: dict[str, float] = {}
    for pattern, frame in shown:
        shares[pattern.capture] = share = frame.at_highest if frame.highest >= white else 0.0
        if share > MOST_SATURATED and pattern.role != DARK:
            faults.append(
                f"saturated: {share:.2%} of {pattern.capture} is at {white:g} counts, more than {MOST_SATURATED:.1%}; "
                "shorten the session's exposure and photograph all patterns again"
            )
    highest = max(frame.highest for pattern, frame in shown if pattern.role != DARK)
    if highest < DIM * white:
        notes.append(
            f"the brightest photograph uses {highest / white:.0%} of the camera's {white:g} counts: expose longer, "
            "since noise and rounding weigh more than they need"
        )
    if white <= EIGHT_BITS:
        notes.append("photographs have 8 bits or fewer: what is dark is rounded, which can change a ranking")
    if not all(frame.linear for _, frame in shown):
        notes.append("photographs are JPEG, decoded as sRGB: not linear in light, so that scores are indicative only")
    return Series(white, shares, tuple(notes)), _shortened(faults)


def _white(frames: Sequence[Facts]) -> tuple[float, list[str]]:
    """Counts of a saturated sample: of the fewest bits that hold every photograph, wherever in 16 they lie.

    Or less, where several photographs share a brightest count that many of their samples have: a camera, or what came
    after it, that clips before the last level (not where the light reaches a few counts of 8 bits only).
    """
    highest = max(frame.highest for frame in frames)
    top, step = frames[0].top, min((frame.step for frame in frames if frame.step), default=1)
    if top not in (255.0, 65535.0):
        return top, []
    bits = next(depth for depth in DEPTHS if highest <= 2**depth - 1)
    clipped = [frame for frame in frames if frame.highest == highest > 2 ** (bits - 1)]
    if len(clipped) > 1 and max(frame.at_highest for frame in clipped) > MOST_SATURATED:
        return highest, []
    if top == 65535.0 and step >= 4:
        depth = 16 - int(np.log2(step))
        return top - step + 1, [f"photographs have {depth} bits at the upper end of 16: steps of {step} counts"]
    notes = [f"photographs have {bits} bits at the lower end of 16"] if top == 65535.0 and bits < 16 else []
    return float(2**bits - 1), notes


def _kinds(shown: Sequence[tuple[Pattern, Facts]]) -> list[str]:
    """Photographs saved in another way than most: their counts cannot be compared."""
    kinds = [(frame.top, frame.linear) for _, frame in shown]
    usual = max(set(kinds), key=kinds.count)
    odd = [pattern.capture for (pattern, _), kind in zip(shown, kinds, strict=True) if kind != usual]
    return _told(odd, "another kind of file: {}; save all photographs with the same depth and format")


def _sizes(shown: Sequence[tuple[Pattern, Facts]]) -> list[str]:
    """Photographs of another size than most."""
    shapes = [frame.shape for _, frame in shown]
    usual = max(set(shapes), key=shapes.count)
    odd = [f"{pattern.capture} has {frame.shape}" for pattern, frame in shown if frame.shape != usual]
    return _told(odd, f"wrong size: {{}}, most have {usual} pixels")


def _repeated(shown: Sequence[tuple[Pattern, Facts]]) -> list[str]:
    """Photographs with the same counts: noise alone makes two differ. Dark frames may have none at all."""
    faults, first = [], dict[str, Pattern]()
    for pattern, frame in shown:
        if pattern.role == DARK and not frame.highest:
            continue
        before = first.setdefault(frame.content, pattern)
        if before is pattern:
            continue
        if before.number + 1 == pattern.number:
            faults.append(f"stale frame: {pattern.capture} is {before.capture} again; the camera gave an old frame")
        else:
            faults.append(f"duplicated: {pattern.capture} and {before.capture} are the same picture")
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
    patterns: Sequence[Pattern], seen: Mapping[str, NDArray[np.float64]], wanted: Mapping[str, NDArray[np.float64]]
) -> list[str]:
    """Faults: photographs that show another hologram of their round than their name says.

    seen, wanted: ``thumbnail`` of the registered photograph, and of what the nominal optics predict, by capture name.
    Holograms of one picture look alike whoever made them, and so do all of the fiducial grid: this finds photographs of
    another *picture*.
    """
    known = [pattern for pattern in patterns if pattern.capture in seen]
    faults = []
    for colour in sorted({pattern.colour for pattern in known}):
        same = [pattern for pattern in known if pattern.colour == colour]
        expected, found = (np.stack([rows[one.capture] for one in same]) for rows in (wanted, seen))
        likeness = expected @ found.T
        grids = np.array([pattern.role != HOLOGRAM for pattern in same])
        for index, pattern in enumerate(same):
            alike = likeness[:, index]
            own = alike[grids].max() if grids[index] else alike[index]
            best = int(np.where(grids, -np.inf, alike).argmax()) if grids[index] else int(alike.argmax())
            if alike[best] > own + CLEARLY:
                faults.append(f"wrong order: {pattern.capture} shows pattern {same[best].number:04d}")
    return _shortened(faults)


def thumbnail(picture: NDArray[np.float32]) -> NDArray[np.float64]:
    """A small picture of square-root light as a row of zero mean and length one."""
    shrink = max(1.0, max(picture.shape) / THUMBNAIL)
    size = (max(1, round(picture.shape[1] / shrink)), max(1, round(picture.shape[0] / shrink)))
    small = cv2.resize(np.sqrt(np.maximum(picture, 0)), size, interpolation=cv2.INTER_AREA)
    row = np.asarray(small, dtype=np.float64).ravel() - float(small.mean())
    return np.asarray(row / max(float(np.linalg.norm(row)), 1e-12))


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
