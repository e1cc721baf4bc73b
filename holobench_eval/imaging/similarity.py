"""How alike a capture and its target are under a warp, in structures far coarser than speckle; part by part."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from .warp import Array, Frame, Warp

SIDE = 96  # pixels of the longer side at which pictures are compared: averages over speckle grains
SURROUNDINGS = 0.08  # of the longer side: structures wider than this are illumination
FLAT = 0.3  # of the strongest local contrast: fainter structure is not amplified to full contrast
PARTS = 3  # a side
FAINTEST = 0.004  # of full scale, standard deviation of the structure in a part; one level of 8 bits
SEEN = 0.5  # of a part that the capture has to cover
REACH = 8  # pixels: how far each way a part is looked for
NEAR = 2.0  # pixels: a part that fits best there is where it should be
BETTER = 0.05  # in correlation: a part that fits better elsewhere by less is where it should be

Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class View:
    """A capture seen in the frame of a reduced target.

    reference, picture: ``(h, w)`` the reduced target and the capture; inside: ``(h, w)`` where the capture is;
    to_target: ``(3, 3)`` from pixels of the view to those of the target.
    """

    reference: Frame
    picture: Frame
    inside: Mask
    to_target: Array

    def even(self) -> tuple[Frame, Frame]:
        """Target and capture without illumination and local contrast, zero outside the capture."""
        return evened(self.reference, self.inside), evened(self.picture, self.inside)


@dataclass(frozen=True)
class Similarity:
    """Correlation of a capture with its target under a warp: overall, and of each part that holds structure.

    displaced: of each such part, whether it fits clearly better a little elsewhere.
    """

    overall: float
    parts: tuple[float, ...] = ()
    displaced: tuple[bool, ...] = ()


def reduced(picture: Frame, side: int) -> tuple[Frame, Array]:
    """A picture whose longer side is at most ``side`` px, and the map ``(3, 3)`` from its pixels to the picture's."""
    factor = side / max(picture.shape)
    if factor >= 1:
        return picture, np.eye(3)
    height, width = (max(1, round(edge * factor)) for edge in picture.shape)
    small = cv2.resize(picture, (width, height), interpolation=cv2.INTER_AREA)
    x, y = picture.shape[1] / width, picture.shape[0] / height
    return np.asarray(small), np.array([[x, 0, x / 2 - 0.5], [0, y, y / 2 - 0.5], [0, 0, 1.0]])


def view(frame: Frame, reference: Frame, warp: Warp, side: int = SIDE) -> View:
    """A capture ``(Hs, Ws)`` in the frame of its target ``(h, w)``, both reduced to ``side`` px."""
    small, to_target = reduced(reference, side)
    to_frame = warp.homography @ to_target
    scale = Warp((small.shape[0], small.shape[1]), to_frame, np.zeros((6, 2))).scale()
    shrunk, back = reduced(frame, max(8, int(max(frame.shape) / max(1.0, scale))))
    to_shrunk = np.linalg.inv(back) @ to_frame
    size = (small.shape[1], small.shape[0])
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    picture = np.asarray(cv2.warpPerspective(shrunk, to_shrunk, size, flags=flags), dtype=np.float32)
    inside = cv2.warpPerspective(np.ones_like(shrunk), to_shrunk, size, flags=flags) > 0.999
    return View(small, picture, np.asarray(inside), to_target)


def evened(picture: Frame, inside: Mask) -> Frame:
    """A picture less its surroundings' mean and over their contrast; zero outside the mask."""
    width = SURROUNDINGS * max(picture.shape)
    there = inside.astype(np.float32)

    def mean(values: Frame) -> Frame:
        return np.asarray(cv2.GaussianBlur(values * there, (0, 0), width) / weight, dtype=np.float32)

    weight = np.maximum(np.asarray(cv2.GaussianBlur(there, (0, 0), width)), 1e-6)
    structure = (picture - mean(picture)) * there
    contrast = np.sqrt(np.maximum(mean(structure * structure), 0))
    return np.asarray(structure / (contrast + FLAT * contrast.max() + 1e-9), dtype=np.float32)


def similarity(frame: Frame, reference: Frame, warp: Warp) -> Similarity:
    """How alike a capture ``(Hs, Ws)`` and its target ``(h, w)`` are under a warp; -1 where too little is covered."""
    seen = view(frame, reference, warp)
    if seen.inside.mean() < SEEN:
        return Similarity(-1.0)
    target, capture = seen.even()
    parts = [part for part in structured(seen.reference) if seen.inside[part].mean() >= SEEN]
    alike = [_masked_correlation(target[part], capture[part], seen.inside[part]) for part in parts]
    displaced = tuple(_displaced(target, capture, part) for part in parts)
    return Similarity(_masked_correlation(target, capture, seen.inside), tuple(alike), displaced)


def is_displaced(frame: Frame, reference: Frame, warp: Warp) -> bool:
    """Whether a capture ``(Hs, Ws)`` as a whole fits its target ``(h, w)`` clearly better a little elsewhere."""
    seen = view(frame, reference, warp)
    height, width = seen.inside.shape
    return _displaced(*seen.even(), (slice(0, height), slice(0, width)))


def _displaced(target: Frame, capture: Frame, part: tuple[slice, slice]) -> bool:
    """Whether a part of the capture fits the target clearly better some pixels away."""
    wide = cv2.copyMakeBorder(target, REACH, REACH, REACH, REACH, cv2.BORDER_CONSTANT, value=0.0)
    row, column = (slice(span.start, span.stop + 2 * REACH) for span in part)
    alike = cv2.matchTemplate(wide[row, column], np.ascontiguousarray(capture[part]), cv2.TM_CCOEFF_NORMED)
    y, x = np.unravel_index(int(alike.argmax()), alike.shape)
    better = float(alike[y, x] - alike[REACH, REACH]) > BETTER
    return better and float(np.hypot(y - REACH, x - REACH)) > NEAR


def structured(reference: Frame) -> list[tuple[slice, slice]]:
    """The parts of a target ``(h, w)`` in full scale 1 that hold structure: rows and columns of each."""
    small, _ = reduced(reference, SIDE)
    structure = small - np.asarray(cv2.GaussianBlur(small, (0, 0), SURROUNDINGS * max(small.shape)))
    rows, columns = (_thirds(edge) for edge in small.shape)
    return [(row, column) for row in rows for column in columns if structure[row, column].std() >= FAINTEST]


def _thirds(edge: int) -> list[slice]:
    ends = [edge * part // PARTS for part in range(PARTS + 1)]
    return [slice(*pair) for pair in itertools.pairwise(ends)]


def _masked_correlation(a: Frame, b: Frame, where: Mask) -> float:
    a, b = a[where].astype(np.float64), b[where].astype(np.float64)
    return float((a * b).sum() / np.sqrt(max((a * a).sum() * (b * b).sum(), 1e-24)))
