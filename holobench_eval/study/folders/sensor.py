"""What a camera does that light does not: samples that are clipped, and pixels that stand out from all around them."""

from __future__ import annotations

import math

import cv2
import numpy as np

from ...imaging.shared_pose import sampled
from ...imaging.similarity import Mask
from ...imaging.standing_out import hot_and_dead
from ...imaging.warp import Frame, Warp
from ...lab.photograph import MOST_SATURATED
from .exposure import SAMPLED, area

BINS = 500  # up to the brightest; counts less a dark frame pile up in a few of them, and not at one value
FEWEST = 20  # bins up to the brightest, of captures of few levels
PILE = 2.5e-4  # of the samples in three bins: fewer are no pile
BELOW = 6  # bins: a pile has more than these and all above it, where light and noise leave fewer and fewer
SAME = 0.012  # of their value: levels of a target that are equal, as bright ones that are neighbours in 8 bits
NOISY = 0.03  # of its value, between neighbours that are equal in the target: then no part of a capture is even
AROUND = np.ones((5, 5), np.uint8)  # as far as a blur takes light

LINE = 0.01  # of the brightest thousandth, by which a row stands out by its median
MOSAIC = 1.1  # between the means of every second row and column


def clipped(frame: Frame, target: Frame, warp: Warp, full: float) -> Mask:
    """Which samples ``(C, h, w)`` of a capture ``(C, Hs, Ws)`` are clipped.

    At full scale; or below it, where a camera's well or its software ends, at a value at which samples pile up. A pile
    is no clipping where the target ``(C, h, w)`` itself is even and the capture has no noise.
    """
    seen = sampled((frame >= full).astype(np.float32), warp) > 0.5
    for plane, shown, own in zip(frame, target, seen, strict=True):
        if own.mean() > MOST_SATURATED:
            continue
        top = _pile(plane, warp)
        piled = sampled((plane[None] >= top).astype(np.float32), warp)[0] > 0.5
        if piled.any() and not _even(sampled(plane[None], warp)[0], shown, piled):
            own |= piled
    return np.asarray(seen)


def _pile(plane: Frame, warp: Warp) -> float:
    """The value from which samples pile up; infinite where they do not."""
    part, mask = area(plane, warp)
    step = max(1, min(mask.shape) // SAMPLED)
    values = plane[part][::step, ::step][mask[::step, ::step]]
    brightest = float(np.percentile(values, 99.9)) if values.size else 0.0
    if brightest <= 0:
        return math.inf
    step = float(np.diff(np.unique(values)).min(initial=math.inf))  # between levels, which may be few
    width = max(brightest / BINS, min(step, brightest / FEWEST))
    counts = np.bincount(np.round(values.clip(0, 2 * brightest) / width).astype(int), minlength=3) / values.size
    least = np.cumsum(np.pad(counts, (BELOW + 2, 0)))  # up to each bin, from BELOW + 2 before the first
    share = np.convolve(counts, np.ones(3), "same")
    below, above = least[BELOW:-2] - least[: -BELOW - 2], 1 - np.append(least, 1)[BELOW + 3 :]
    piles = np.flatnonzero((share >= PILE) & (share > below + above) & (above < MOST_SATURATED))
    if not piles.size:
        return math.inf
    first = max(int(piles[0]) - 1, 0)
    return float(first + np.argmax(counts[first : first + 3] > share[piles[0]] / 4) - 0.5) * width


def _even(capture: Frame, target: Frame, piled: Mask) -> bool:
    """Whether a pile is that of an even part of the target, in a capture ``(h, w)`` without noise."""
    low, high = np.percentile(capture[piled], (5, 95))
    typical = float(np.median(target[piled]))
    same = np.abs(target - typical) <= (SAME + (high - low) / high) * typical
    inside = cv2.erode(same.astype(np.uint8), AROUND) > 0
    even = ~piled & (cv2.dilate(target, AROUND) - cv2.erode(target, AROUND) <= SAME * target)
    steps, light, rest = np.abs(np.diff(capture)), capture[:, 1:], even[:, 1:] & even[:, :-1]
    if not (rest.any() or inside.any()):  # a fine pattern
        rest = ~(piled[:, 1:] | piled[:, :-1]) & (np.abs(np.diff(target)) <= SAME * target[:, 1:])
    seen = rest & (light > low / BINS)
    quiet = not rest.any() or (seen.any() and float(np.median(steps[seen] / light[seen])) < NOISY)
    quiet = quiet or float(np.median(steps[rest])) <= high - low  # noise in the dark, of which the pile has as much
    return bool(quiet and same[piled].mean() > 0.9 and (not inside.any() or piled[inside].mean() > 0.5))


def mended(frame: Frame, warp: Warp) -> tuple[Frame, int]:
    """Light ``(C, Hs, Ws)`` without what stands out from all around it, as no light does, and how many samples that
    were where the target is.

    Pixels alone become the median about them, rows and columns the mean of those beside them, and the sites of a
    mosaic, or two interlaced fields, equally bright.
    """
    better = frame.copy()
    for plane in better:
        part, _ = area(plane, warp)
        plane[part] = _mended(plane[part])
    return better, int((better != frame).sum())


def _mended(plane: Frame) -> Frame:
    dark, bright = np.percentile(plane, (1, 99.9)).astype(np.float32)
    even, bright = plane - dark, bright - dark
    sites = np.array([[np.median(even[row::2, column::2]) for column in (0, 1)] for row in (0, 1)])
    if sites.max() > MOSAIC * sites.min() > 0:
        even *= np.tile(sites.mean() / sites, [-(-side // 2) for side in even.shape])[: even.shape[0], : even.shape[1]]
    for lines in (even, even.T):
        before, here, after = lines[:-2], lines[1:-1], lines[2:]
        over, under = here - np.maximum(before, after), np.minimum(before, after) - here
        odd = np.maximum(np.median(over, axis=1), np.median(under, axis=1)) > LINE * bright
        here[odd] = (before + after)[odd] / 2
    odd = np.logical_or(*hot_and_dead(even))
    even[odd] = cv2.medianBlur(even, 3)[odd]
    return np.where(even == plane - dark, plane, even + dark)
