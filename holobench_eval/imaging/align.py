"""Alignment from the pictures themselves: where a target lies in a capture, where no fiducial was photographed.

Features or templates propose where the target may lie, the enhanced correlation coefficient (Evangelidis & Psarakis
2008) refines it from coarse to fine, and the result is refused unless target and capture are alike all over.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ..core.errors import CellError
from .features import by_features, by_templates
from .similarity import PARTS, SIDE, Similarity, is_displaced, reduced, similarity, structured, view
from .warp import Array, Frame, Warp

ALIKE = 0.6  # least correlation of target and capture; pairs of other pictures stay below 0.45
ALIKE_IN_POSE = 0.25  # the same where the pose is known: other pictures stay below 0.15
PART_ALIKE = 0.3  # least correlation of a part
PART_ALIKE_IN_POSE = 0.1
CLEARLY = 0.02  # in correlation, by which a turned or mirrored target has to fit better or worse
SAME = 0.98  # correlation of a target with itself turned or mirrored from which on this makes no difference
STRIPES = 0.02  # of the mean squared slope along one direction: less along the other is none
HOPEFUL = 0.2  # least correlation of a proposal that is worth refining
FEWEST_PARTS = 4  # with structure, of nine
NEARLY = 0.1  # in correlation: what the fine levels may add
COARSE = (64, 128, 256)  # pixels of the target's longer side at which it is refined
FINE = (512, 1024)
ECC_BLUR = 5  # pixels, odd: the filter before each step
ECC_ITERATIONS = 60
ECC_STEP = 1e-6
FURTHEST_REFINED = 0.15  # of the target's longer side in the capture: how far a corner moves in the refinement
STEEPEST = 2.5  # between the scales at two corners
OVERHANG = 2.0  # target pixels that may lie beyond the capture's border
SCALES = (0.2, 8.0)  # capture pixels a target pixel
PLAIN = "the target has structure in"  # begins what is refused by a fault of the target alone
RESIZE = "resize the target"  # ends it
IMPOSSIBLE = "folded"  # no camera sees a display so


@dataclass(frozen=True, eq=False)
class Alignment:
    """Where a target lies in a capture.

    Parameters
    ----------
    warp
        From pixels of the target to pixels of the capture.
    correlation
        Of the two there, in structures far coarser than speckle.
    """

    warp: Warp
    correlation: float

    def to_dict(self) -> dict[str, Any]:
        """Plain lists and numbers; `from_dict` reads them back exactly."""
        shape, homography = list(self.warp.shape), self.warp.homography.tolist()
        return {"shape": shape, "homography": homography, "correlation": self.correlation}

    @classmethod
    def from_dict(cls, plain: Mapping[str, Any]) -> Alignment:
        """The alignment that `to_dict` described."""
        height, width = plain["shape"]
        return cls(_planar((height, width), np.array(plain["homography"])), float(plain["correlation"]))


def align(capture: NDArray[np.floating], target: NDArray[np.floating], partly: bool = False) -> Alignment:
    """Find a target in its capture, from the two alone.

    Enhanced correlation coefficient from coarse to fine (Evangelidis & Psarakis, IEEE Trans. Pattern Anal. Mach.
    Intell. 30, 1858, 2008), from where features or templates propose. The target may be mirrored, turned by quarters
    and by some degrees more, seen in perspective, scaled by 0.2 to 8, and fill a part of the capture; all of it must be
    there, or half of it where ``partly``.

    Parameters
    ----------
    capture
        ``(C', Hs, Ws)`` in [0, 1], values as displays are given them, or square roots of light.
    target
        ``(C, h, w)``, as the capture.
    partly
        Whether up to half of the target may lie beyond the capture's border.

    Raises
    ------
    CellError
        The target has too little structure, it is not found, or it is found where it cannot be scored.

    Examples
    --------
    >>> from skimage.data import camera
    >>> target = camera()[None, ::2, ::2] / 255
    >>> alignment = align(np.pad(target, ((0, 0), (30, 20), (40, 60))), target)
    >>> [round(float(edge)) for edge in alignment.warp.corners()[0]]
    [40, 30]
    """
    frame, reference = gray(capture), gray(target)
    _refuse_plain(reference)
    best, closest = -1.0, (ALIKE - NEARLY, "")  # the second: the most alike of the starts that are not tried, and why
    for start in _proposals(frame, reference, partly):
        fault = _fault(start, frame.shape, partly, around=0.6)
        alike = similarity(frame, reference, start) if fault != IMPOSSIBLE else Similarity(-1.0)
        if fault or alike.overall < HOPEFUL:
            closest = max(closest, (alike.overall, fault))
            continue
        near = refined(frame, reference, start, COARSE)
        alike = similarity(frame, reference, near)
        best = max(best, alike.overall)
        if alike.overall < ALIKE - NEARLY:
            continue
        warp = refined(frame, reference, near, FINE)
        if accepted(similarity(frame, reference, warp)) and _fault(warp, frame.shape, partly) != IMPOSSIBLE:
            warp = _settled(frame, reference, warp)
            alike = similarity(frame, reference, warp)
            fault = _fault(warp, frame.shape, partly)
            if accepted(alike) and fault != IMPOSSIBLE:
                if fault:
                    raise CellError(_found(alike.overall, fault))
                return Alignment(warp, alike.overall)
    if closest[1]:
        raise CellError(_found(*closest))
    if best >= ALIKE:
        raise CellError(
            f"the target is not found in the capture as a whole: the two are alike (correlation {best:.2f}), but parts "
            "of the target are missing, displaced or replaced there"
        )
    seen = f"the best correlation is {best:.2f}, and {ALIKE} is needed" if best > 0 else "nothing is alike"
    cut = "less than half of it is on the capture" if partly else "cut off"
    raise CellError(
        f"the target is not found in the capture ({seen}): it shows another picture, or is too faint, too speckled, "
        f"stretched, turned by an angle or {cut}"
    )


def _found(correlation: float, fault: str) -> str:
    return f"the target is found in the capture (correlation {correlation:.2f}), but {fault}"


def _settled(frame: Frame, reference: Frame, warp: Warp) -> Warp:
    """The warp, or the same after a turn or a mirror of the target where that fits better.

    Raises `CellError` where one fits as well, unless the target itself looks the same.
    """
    here, rivals = similarity(frame, reference, warp).overall, []
    for symmetry in _symmetries(warp.shape):
        if similarity(reference, reference, symmetry).overall < SAME:
            start = _planar(warp.shape, warp.homography @ symmetry.homography)
            turned = refined(frame, reference, start, COARSE[:-1])
            rivals.append((similarity(frame, reference, turned).overall, turned))
    best, other = max(rivals, key=lambda rival: rival[0], default=(-1.0, warp))
    if abs(best - here) < CLEARLY:
        raise CellError("the target is found in the capture in two ways, one of them turned or mirrored, equally well")
    return warp if best < here else refined(frame, reference, other, COARSE + FINE)


def _symmetries(shape: tuple[int, int]) -> Iterator[Warp]:
    """The turns by quarters and the mirrors of a target about its centre, without the one that changes nothing."""
    centre = np.eye(3)
    centre[:2, 2] = (shape[1] - 1) / 2, (shape[0] - 1) / 2
    for across, down, swapped in itertools.product((1.0, -1.0), (1.0, -1.0), (False, True)):
        linear = np.array([[0, across], [down, 0]]) if swapped else np.diag([across, down])
        if swapped or (across, down) != (1.0, 1.0):
            turn = np.eye(3)
            turn[:2, :2] = linear
            yield _planar(shape, centre @ turn @ np.linalg.inv(centre))


def is_same_mirrored(target: NDArray[np.floating]) -> bool:
    """Whether a target ``(C, h, w)`` looks the same mirrored about some axis, so that its captures do not tell."""
    reference = gray(target)
    mirrors = [warp for warp in _symmetries(reference.shape) if np.linalg.det(warp.homography) < 0]
    return any(similarity(reference, reference, mirror).overall >= SAME for mirror in mirrors)


def confirmed(
    capture: NDArray[np.floating], target: NDArray[np.floating], warp: Warp, partly: bool = False
) -> Alignment | None:
    """The alignment by the pose of other captures of a session, where capture and target are alike under it; else None.

    Less likeness than `align` asks for is enough, as nothing is searched: no other picture comes near `ALIKE_IN_POSE`
    in one given pose, and speckle hides a picture long before that. A capture that fits better a little elsewhere was
    taken in another pose.
    """
    frame, reference = gray(capture), gray(target)
    alike = similarity(frame, reference, warp)
    # A part counts once: heavy speckle makes the same part of an honest capture both faint and displaced.
    odd = sum(part < PART_ALIKE_IN_POSE or moved for part, moved in zip(alike.parts, alike.displaced, strict=True))
    enough = alike.overall >= ALIKE_IN_POSE and len(alike.parts) >= FEWEST_PARTS and odd <= len(alike.parts) // 6
    if not enough or is_displaced(frame, reference, warp) or _fault(warp, frame.shape, partly):
        return None
    return Alignment(warp, alike.overall)


def gray(picture: NDArray[np.floating]) -> Frame:
    """The mean over the channels of ``(C, h, w)``."""
    return np.ascontiguousarray(picture.mean(axis=0), dtype=np.float32)


def accepted(alike: Similarity) -> bool:
    """Whether two pictures are alike overall and in their parts, of which one in six may be odd."""
    odd = sum(part < PART_ALIKE for part in alike.parts) + sum(alike.displaced)
    return alike.overall >= ALIKE and len(alike.parts) >= FEWEST_PARTS and odd <= len(alike.parts) // 6


def refined(frame: Frame, reference: Frame, start: Warp, levels: tuple[int, ...]) -> Warp:
    """The warp of highest correlation near ``start``, from coarse to fine.

    A level is kept when the correlation rises there, and all of them when no corner moves too far.
    """
    warp = start
    longest = max(reference.shape)
    for side in sorted({min(side, longest) for side in levels}):
        warp = _climbed(frame, reference, warp, side)
    moved = np.linalg.norm(warp.corners() - start.corners(), axis=1).max()
    return warp if moved <= FURTHEST_REFINED * max(reference.shape) * start.scale() else start


def _climbed(frame: Frame, reference: Frame, warp: Warp, side: int) -> Warp:
    seen = view(frame, reference, warp, side)
    if not seen.inside.any():
        return warp
    target, capture = seen.even()
    stop = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, ECC_ITERATIONS, ECC_STEP)
    inside = seen.inside.astype(np.uint8) * 255
    start = np.eye(3, dtype=np.float32)
    try:
        _, step = cv2.findTransformECC(target, capture, start, cv2.MOTION_HOMOGRAPHY, stop, inside, ECC_BLUR)
    except cv2.error:  # it does not converge
        return warp
    homography = warp.homography @ seen.to_target @ np.asarray(step, np.float64) @ np.linalg.inv(seen.to_target)
    after = _planar(warp.shape, homography)
    before = _blurred_correlation(target, capture, seen.inside)
    again = view(frame, reference, after, side)
    return after if _blurred_correlation(*again.even(), again.inside & seen.inside) > before else warp


def _blurred_correlation(target: Frame, capture: Frame, inside: NDArray[np.bool_]) -> float:
    if inside.sum() < 0.5 * inside.size:
        return -1.0
    a, b = (np.asarray(cv2.GaussianBlur(side, (ECC_BLUR, ECC_BLUR), 0))[inside] for side in (target, capture))
    return float(np.corrcoef(a, b)[0, 1]) if min(a.std(), b.std()) > 0 else -1.0


def _proposals(frame: Frame, reference: Frame, partly: bool) -> Iterator[Warp]:
    """Where the target may lie, likely places first."""
    shape = (reference.shape[0], reference.shape[1])
    yield from (_planar(shape, homography) for homography in by_features(frame, reference))
    yield from (_planar(shape, homography) for homography in by_templates(frame, reference, partly))
    across, down = frame.shape[1] / shape[1], frame.shape[0] / shape[0]  # stretched to the whole capture
    yield _planar(shape, np.array([[across, 0, across / 2 - 0.5], [0, down, down / 2 - 0.5], [0, 0, 1]]))


def _planar(shape: tuple[int, int], homography: Array) -> Warp:
    return Warp(shape, homography / homography[2, 2], np.zeros((6, 2)))


def _fault(warp: Warp, frame: tuple[int, ...], partly: bool, around: float = 0.0) -> str:
    """Why a target that lies so cannot be scored: its scale, its place, or `IMPOSSIBLE`; empty where it can.

    partly: a part may lie beyond the border; around: of the capture's longer side, how far it may lie there anyway.
    """
    shape, homography = warp.shape, warp.homography
    ends = np.array(list(itertools.product((0.0, shape[1] - 1.0), (0.0, shape[0] - 1.0))))
    depth = np.column_stack([ends, np.ones(4)]) @ homography[2]
    if not np.isfinite(homography).all() or depth.min() <= 0:
        return IMPOSSIBLE
    scales = (np.abs(np.linalg.det(homography)) / depth**3) ** 0.5
    if not scales.max() <= STEEPEST * scales.min():
        return IMPOSSIBLE
    if not SCALES[0] <= scales.min() <= SCALES[1]:
        return (
            f"it takes {scales.min():.3g} capture pixels for each of its own; {SCALES[0]:g} to {SCALES[1]:g} are "
            f"allowed: {RESIZE}"
        )
    return "" if partly else _overhang(warp, frame, around)


def _refuse_plain(reference: Frame) -> None:
    """Raise `CellError` for a target that gives too little to be found by: flat, nearly black, or stripes."""
    parts = structured(reference)
    rows, columns = ({part[axis].start for part in parts} for axis in (0, 1))
    if len(parts) < FEWEST_PARTS or min(len(rows), len(columns)) < 2:
        share = f"{len(parts)} of its {PARTS * PARTS} parts"
        raise CellError(f"{PLAIN} {share} only, too little to find it by")
    slope_y, slope_x = np.gradient(reduced(reference, SIDE)[0].astype(np.float64))
    spread = np.linalg.eigvalsh(np.cov(slope_x.ravel(), slope_y.ravel()))
    if spread[0] < STRIPES * spread[1]:
        raise CellError(f"{PLAIN} one direction only, along which its place cannot be found")


def _overhang(warp: Warp, frame: tuple[int, ...], around: float) -> str:
    """How far a target reaches beyond which sides of the capture; empty where it is all on it."""
    low, high = warp.corners().min(axis=0), warp.corners().max(axis=0)
    beyond = {"left": -low[0], "upper": -low[1], "right": high[0] - frame[1] + 1, "lower": high[1] - frame[0] + 1}
    allowed = OVERHANG * warp.scale() + around * max(frame)
    sides = [f"{by / warp.scale():.0f} of its pixels on the {side} side" for side, by in beyond.items() if by > allowed]
    if not sides:
        return ""
    return (
        f"it reaches beyond the capture, {' and '.join(sides)}; all of it must be on the capture, unless "
        "--visible scores the part that is"
    )
