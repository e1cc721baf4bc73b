"""Where a target may lie in a capture: by local features, and by templates in many poses where features fail."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator

import cv2
import numpy as np
from numpy.typing import NDArray

from .similarity import evened, reduced
from .warp import Array, Frame

REFERENCE_SIDE = 640  # pixels
FRAME_SIDE = 1280  # pixels
BLURS = (1.0, 2.5, 6.0)  # pixels of the reduced capture: beyond the grain of fine, medium and coarse speckle
FEATURES = 3000
FAINT = 0.02  # contrast of a feature
RATIO = 0.85  # of the distances to the best and the second best match (Lowe 2004)
MATCH_OUTLIER = 4.0  # pixels of the reduced capture
FEWEST = 12  # matches on one homography

TEMPLATE_SIDE = 48  # pixels
FILLED = tuple(1.04 / 1.12**step for step in range(15))  # of the capture's extent, in the template's direction
BEYOND = tuple(1.04 * 1.12**step for step in range(6, 0, -1))  # of a target that is there in part
TILTS = (-8.0, -4.0, 0.0, 4.0, 8.0)  # degrees
KEPT = 6

Features = tuple[Array, Frame]


def by_features(frame: Frame, reference: Frame) -> Iterator[Array]:
    """Homographies ``(3, 3)`` from a target ``(h, w)`` to its capture ``(Hs, Ws)`` that many features agree on.

    SIFT (Lowe 2004) on the target and on its mirror image, as the descriptor knows rotations and no mirrors, and on
    the capture blurred more and more against speckle; MAGSAC++ (Barath et al. 2020) on the matches.
    """
    small, to_reference = reduced(reference, REFERENCE_SIDE)
    shrunk, to_frame = reduced(frame, FRAME_SIDE)
    mirror = np.array([[-1.0, 0, small.shape[1] - 1], [0, 1, 0], [0, 0, 1]])
    sides = [(np.eye(3), _features(small)), (mirror, _features(np.ascontiguousarray(small[:, ::-1])))]
    for blur in BLURS:
        features = _features(np.asarray(cv2.GaussianBlur(shrunk, (0, 0), blur)))
        fits = [(*_matched(side, features), unmirrored) for unmirrored, side in sides]
        count, homography, unmirrored = max(fits, key=lambda fit: fit[0])
        if count >= FEWEST and homography is not None:
            yield to_frame @ homography @ unmirrored @ np.linalg.inv(to_reference)


def _features(picture: Frame) -> Features:
    """Places ``(N, 2)`` and descriptors ``(N, 128)``, as square roots (RootSIFT: Arandjelovic & Zisserman 2012)."""
    dark, bright = np.percentile(picture, (0.5, 99.5))
    levels = np.clip((picture - dark) / max(float(bright - dark), 1e-6), 0, 1) * 255
    detector = cv2.SIFT.create(nfeatures=FEATURES, contrastThreshold=FAINT)
    points, descriptors = detector.detectAndCompute(levels.astype(np.uint8), None)
    if descriptors is None or not points:
        return np.zeros((0, 2)), np.zeros((0, 128), dtype=np.float32)
    shares = descriptors / np.maximum(descriptors.sum(axis=1, keepdims=True), 1e-9)
    return np.array([point.pt for point in points]), np.sqrt(shares).astype(np.float32)


def _matched(source: Features, target: Features) -> tuple[int, Array | None]:
    """How many matches a homography has, and the homography."""
    if min(len(source[0]), len(target[0])) < FEWEST:
        return 0, None
    pairs = cv2.BFMatcher().knnMatch(source[1], target[1], k=2)
    near = [(a.queryIdx, a.trainIdx) for a, b in pairs if a.distance < RATIO * b.distance]
    if len(near) < FEWEST:
        return 0, None
    first, second = np.array(near).T
    homography, inliers = cv2.findHomography(
        source[0][first], target[0][second], cv2.USAC_MAGSAC, MATCH_OUTLIER, maxIters=5000, confidence=0.999
    )
    if homography is None:
        return 0, None
    # Counted in places of the source: a repeated pattern may match one place a hundred times.
    places = {tuple(point) for point in np.round(source[0][first][inliers.ravel() > 0] / MATCH_OUTLIER)}
    targets = {tuple(point) for point in np.round(target[0][second][inliers.ravel() > 0] / MATCH_OUTLIER)}
    return min(len(places), len(targets)), np.asarray(homography, dtype=np.float64)


def by_templates(frame: Frame, reference: Frame, partly: bool = False) -> list[Array]:
    """The similarities ``(3, 3)`` from a target to its capture that correlate best, of many scales, turns and mirrors.

    For pictures whose features drown in speckle: it averages over the whole target. Rotations are within 10 degrees
    of a quarter turn. partly: up to half of the target may lie beyond the capture's border.
    """
    small, to_reference = reduced(reference, TEMPLATE_SIDE)
    template = evened(small, np.ones(small.shape, dtype=bool))
    matches: list[tuple[float, Array]] = []
    for filled, turns in itertools.product((*BEYOND, *FILLED) if partly else FILLED, (0, 1)):
        height, width = small.shape if turns == 0 else small.shape[::-1]
        wanted = max(height / frame.shape[0], width / frame.shape[1]) / filled  # template pixels a capture pixel
        if wanted >= 1:
            continue
        shrunk, to_frame = reduced(frame, round(max(frame.shape) * wanted))
        scene = evened(shrunk, np.ones(shrunk.shape, dtype=bool))
        border = TEMPLATE_SIDE // (2 if partly else 4)
        scene = np.asarray(cv2.copyMakeBorder(scene, border, border, border, border, cv2.BORDER_CONSTANT, value=0.0))
        for half, mirrored, tilt in itertools.product((0, 2), (False, True), TILTS):
            turned, to_turned = _turned(template, math.radians(90 * (turns + half) + tilt), mirrored)
            if turned.shape[0] > scene.shape[0] or turned.shape[1] > scene.shape[1]:
                continue
            alike = np.asarray(cv2.matchTemplate(scene, turned, cv2.TM_CCORR_NORMED))
            row, column = np.unravel_index(int(alike.argmax()), alike.shape)
            shift = np.array([[1.0, 0, column - border], [0, 1, row - border], [0, 0, 1]])
            matches.append((float(alike[row, column]), to_frame @ shift @ to_turned @ np.linalg.inv(to_reference)))
    return [homography for _, homography in sorted(matches, key=lambda match: -match[0])[:KEPT]]


def _turned(template: Frame, angle: float, mirrored: bool) -> tuple[Frame, NDArray[np.float64]]:
    """A template turned about its centre, in a picture that holds all of it, and the map ``(3, 3)`` into that."""
    height, width = template.shape
    cosine, sine = math.cos(angle), math.sin(angle)
    wide = math.ceil(abs(cosine) * width + abs(sine) * height)
    tall = math.ceil(abs(sine) * width + abs(cosine) * height)
    centre = np.array([[1, 0, -(width - 1) / 2], [0, 1, -(height - 1) / 2], [0, 0, 1]])
    mirror = np.diag([-1.0 if mirrored else 1.0, 1.0, 1.0])
    turn = np.array([[cosine, -sine, (wide - 1) / 2], [sine, cosine, (tall - 1) / 2], [0, 0, 1]])
    to_turned = turn @ mirror @ centre
    return np.asarray(cv2.warpPerspective(template, to_turned, (wide, tall))), to_turned
