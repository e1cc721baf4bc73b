"""Everything that can be wrong with a series of photographs, looked for before any of them is scored."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from ..photograph import MOST_SATURATED
from .frames import Facts
from .manifest import DARK, HOLOGRAM, Pattern

DEPTHS = (8, 10, 12, 14, 16)
EIGHT_BITS = 255.0
DIM = 0.4  # of the camera's range: a series whose brightest sample stays below is exposed too short
BRIGHTEST_DARK = 0.2  # of the mean of the other photographs: a dark frame as bright as this had the laser on
LISTED = 5  # faults of one kind that are named
THUMBNAIL = 96  # pixels of the longer side of the small pictures that tell which hologram a photograph shows
SURROUNDINGS = 0.04  # of its longer side: what is smoother there is illumination, in which all photographs are alike
CLEARLY = 0.1  # by how much another pattern's picture is more like a photograph than its own, in correlation
GRAIN = 1.0  # region pixels: structure finer than this differs between holograms of one target
TOLD, SPREAD = 0.02, 4.0  # least correlation of differences that tells two holograms apart; in units of chance

Numbered = Sequence[tuple[Pattern, Facts]]  # the photographs of a round, each with the pattern that it should show


@dataclass(frozen=True)
class Series:
    """The photographs of a round that can be used.

    saturated: fraction of saturated samples, by capture name; notes: what a reader of the scores should know, line by
    line.
    """

    saturated: Mapping[str, float]
    notes: tuple[str, ...]


def check_present(folder: Path, patterns: Sequence[Pattern], files: Mapping[str, Path | None]) -> list[str]:
    """Faults: photographs that are not there; files: that of every capture, by its name."""
    missing = [pattern.capture for pattern in patterns if files[pattern.capture] is None]
    if len(missing) == len(patterns):
        return [f"none of the {len(missing)} photographs is in {folder / Path(missing[0]).parent}"]
    return _line_of(missing, "missing: {} (.png, .tif or the camera's RAW)")


def check_series(patterns: Sequence[Pattern], facts: Mapping[str, Facts]) -> tuple[Series, list[str]]:
    """What the photographs of a round have in common, and the faults of single ones, a line each.

    facts: by the name of a pattern's capture, complete.
    """
    photographs = [(pattern, facts[pattern.capture]) for pattern in patterns]
    faults = _unlike_most(photographs) or [*_repeated(photographs), *_dark(photographs)]
    white, notes = _white([frame for _, frame in photographs])
    shares: dict[str, float] = {}
    for pattern, frame in photographs:
        shares[pattern.capture] = share = frame.at_highest if frame.highest >= white else 0.0
        if share > MOST_SATURATED and pattern.role != DARK:
            faults.append(
                f"saturated: {share:.2%} of {pattern.capture} is at {white:g} counts, more than {MOST_SATURATED:.1%}; "
                "shorten the session's exposure and photograph all patterns again"
            )
    highest = max(frame.highest for pattern, frame in photographs if pattern.role != DARK)
    if highest < DIM * white:
        notes.append(
            f"the brightest photograph uses {highest / white:.0%} of the camera's {white:g} counts: expose longer, "
            "since noise and rounding weigh more than they need"
        )
    if white <= EIGHT_BITS:
        notes.append("photographs have 8 bits or fewer: what is dark is rounded, which can change a ranking")
    if not all(frame.linear for _, frame in photographs):
        notes.append("photographs are JPEG, decoded as sRGB: not linear in light, so that scores are indicative only")
    return Series(shares, tuple(notes)), shortened(faults)


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


def _unlike_most(photographs: Numbered) -> list[str]:
    """Photographs that were saved in another way than most, whose counts cannot be compared; else of another size."""
    kinds = [(frame.top, frame.linear) for _, frame in photographs]
    usual = max(set(kinds), key=kinds.count)
    odd = [pattern.capture for (pattern, _), kind in zip(photographs, kinds, strict=True) if kind != usual]
    shapes = [frame.shape for _, frame in photographs]
    size = max(set(shapes), key=shapes.count)
    other = [f"{pattern.capture} has {frame.shape}" for pattern, frame in photographs if frame.shape != size]
    return _line_of(odd, "another kind of file: {}; save all photographs with the same depth and format") or _line_of(
        other, f"wrong size: {{}}, most have {size} pixels"
    )


def _repeated(photographs: Numbered) -> list[str]:
    """Photographs with the same counts: noise alone makes two differ. Dark frames may have none at all."""
    faults, first = [], dict[str, Pattern]()
    for pattern, frame in photographs:
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


def _dark(photographs: Numbered) -> list[str]:
    """Dark frames that are not dark, and bright ones that are no brighter than those."""
    dark = {pattern.capture: frame.mean for pattern, frame in photographs if pattern.role == DARK}
    bright = [frame.mean for pattern, frame in photographs if pattern.role != DARK]
    if not dark or not bright:
        return []
    darkest = min(dark.values())
    light = float(np.median(bright)) - darkest
    if light <= 0:
        return ["no light: the photographs of holograms are no brighter than the dark frames"]
    odd = [capture for capture, mean in dark.items() if mean - darkest > BRIGHTEST_DARK * light]
    return _line_of(odd, "wrong order: {} should be dark; is the laser blocked, and the order that of order.csv?")


def check_order(
    patterns: Sequence[Pattern], seen: Mapping[str, NDArray[np.float64]], wanted: Mapping[str, NDArray[np.float64]]
) -> list[str]:
    """Faults: photographs that show another hologram of their round than their name says.

    seen, wanted: ``thumbnail`` of the registered photograph, and of what the nominal optics predict, by capture name.
    Holograms of one picture look alike whoever made them, and so do all of the fiducial grid: this finds photographs of
    another *picture*, and `check_swaps` the others.
    """
    known = [pattern for pattern in patterns if pattern.capture in seen]
    faults = []
    for colour in sorted({pattern.colour for pattern in known}):
        same = [pattern for pattern in known if pattern.colour == colour]
        expected, photographed = (np.stack([rows[pattern.capture] for pattern in same]) for rows in (wanted, seen))
        grids = np.array([pattern.role != HOLOGRAM for pattern in same])
        for index, (pattern, similarity) in enumerate(zip(same, photographed @ expected.T, strict=True)):
            of_one_target = [other is pattern or (pattern.target == other.target != "") for other in same]
            alike = grids if grids[index] else np.array(of_one_target)
            own = similarity[grids].max() if grids[index] else similarity[index]
            best = int(np.where(alike, -np.inf, similarity).argmax())
            if similarity[best] > own + CLEARLY:
                faults.append(f"wrong order: {pattern.capture} shows pattern {same[best].number:04d}")
    return faults


def check_swaps(
    patterns: Sequence[Pattern], seen: Sequence[NDArray[np.float32]], wanted: Sequence[NDArray[np.float32]]
) -> tuple[list[str], list[str]]:
    """Faults: photographs of one target and colour that changed places; and the pairs that cannot be told apart.

    seen, wanted: ``grain`` of the registered photograph, and of what the nominal optics predict, by pattern. What all
    photographs have in common, the target and most faults of the bench, is not in their differences. The difference of
    two photographs correlates with the difference of their predictions: positively where each is where it belongs,
    negatively where they changed places, and by chance alone where the predictions are too alike or too wrong.
    """
    rows, columns = np.stack(seen), np.stack(wanted)
    own, least = rows @ columns.T, max(TOLD, SPREAD / rows.shape[1] ** 0.5)
    changed, alike = set[tuple[int, int]](), list[str]()
    for first, second in itertools.combinations(range(len(patterns)), 2):
        if _sums(patterns[first]) == _sums(patterns[second]):
            continue
        moved = own[first, first] + own[second, second] - own[first, second] - own[second, first]
        scale = np.linalg.norm(rows[first] - rows[second]) * np.linalg.norm(columns[first] - columns[second])
        correlation = float(moved / max(scale, 1e-12))
        if correlation < -least:
            changed |= {(first, second), (second, first)}
        elif correlation < least:
            alike.append(f"{patterns[first].capture} and {patterns[second].capture}")
    shown = [int(best) for best in linear_sum_assignment(-own)[1]]
    faults = []
    for index, best in enumerate(shown):
        here, there = patterns[index].capture, patterns[best]
        if (index, best) in changed and shown[best] != index:
            faults.append(f"wrong order: {here} shows pattern {there.number:04d}, of the same target")
        elif (index, best) in changed and index < best:
            faults.append(f"wrong order: {here} and {there.capture}, of one target, changed places")
    return faults, alike


def _sums(pattern: Pattern) -> list[str]:
    return [frame.sha256 for frame in pattern.shown]


def grain(picture: NDArray[np.float32]) -> NDArray[np.float32]:
    """The finest structure of a picture in linear light, as a row of zero mean and length one."""
    light = picture / np.float32(max(float(picture.mean()), 1e-12))
    row = (light - np.asarray(cv2.GaussianBlur(light, (0, 0), GRAIN))).ravel()
    row -= row.mean()
    return np.asarray(row / np.float32(max(float(np.linalg.norm(row)), 1e-12)))


def thumbnail(picture: NDArray[np.float32]) -> NDArray[np.float64]:
    """A small picture of square-root light, without its surroundings, as a row of zero mean and length one."""
    shrink = max(1.0, max(picture.shape) / THUMBNAIL)
    size = (max(1, round(picture.shape[1] / shrink)), max(1, round(picture.shape[0] / shrink)))
    small = np.asarray(cv2.resize(np.sqrt(np.maximum(picture, 0)), size, interpolation=cv2.INTER_AREA))
    small = small - np.asarray(cv2.GaussianBlur(small, (0, 0), SURROUNDINGS * max(size)))
    row = np.asarray(small, dtype=np.float64).ravel() - float(small.mean())
    return np.asarray(row / max(float(np.linalg.norm(row)), 1e-12))


def _line_of(names: Sequence[str], line: str) -> list[str]:
    """One line for many names, none for none."""
    more = f" and {len(names) - LISTED} more" if len(names) > LISTED else ""
    return [line.format(", ".join(names[:LISTED]) + more)] if names else []


def shortened(faults: Sequence[str]) -> list[str]:
    """The first faults of every kind, and how many more there are."""
    kinds: dict[str, list[str]] = {}
    for fault in faults:
        kinds.setdefault(fault.partition(":")[0], []).append(fault)
    lines = []
    for kind, of_kind in kinds.items():
        lines += of_kind[:LISTED]
        if len(of_kind) > LISTED:
            lines.append(f"{kind}: {len(of_kind) - LISTED} more")
    return lines
