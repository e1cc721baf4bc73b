"""Measure, to a fraction of a pixel, how far each circle of a rectified grid lies from where it should be."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from .grid import FiducialGrid
from .warp import Array, Frame, Warp, quadratic_surface, quadratic_terms

SAMPLE_BLUR = 0.5  # region pixels: gathers the light between the samples, without rounding the edges away
GROUND_BLUR = 0.8  # of the spacing: wide enough to average speckle, narrow enough to follow scattered light
KNEE = 0.2  # of a circle's light: brighter light counts as simply bright, which tames the speckle inside a circle
FURTHEST_CIRCLE = 2.0  # region pixels that a linearised fit may move a circle


def even_picture(frame: Frame, warp: Warp, grid: FiducialGrid) -> Frame:
    """The grid in region coordinates ``(h, w)``, circles near 1 / (1 + KNEE) and dark ground near 0.

    The light of the dark ground, a smooth surface where light is scattered, is taken off, and the illumination, a
    quadratic in the logarithm of the circles' light (exact for a Gaussian beam), is divided out. Otherwise every circle
    is pulled towards the bright side.
    """
    smooth = cv2.GaussianBlur(frame, (0, 0), SAMPLE_BLUR * warp.scale())
    picture = warp.sample(np.asarray(smooth))
    dark = (grid.image.numpy() == 0).astype(np.float32)
    ground, share = (cv2.GaussianBlur(each, (0, 0), GROUND_BLUR * grid.spacing) for each in (picture * dark, dark))
    picture = picture - np.asarray(ground / share)  # the local mean over the dark pixels of the grid
    light = np.asarray(cv2.GaussianBlur(picture, (0, 0), 0.5 * grid.radius))
    columns, rows = np.round(grid.centres).astype(int).T
    circles = light[rows, columns].astype(np.float64)
    circles = np.log(np.maximum(circles, max(0.05 * float(np.median(circles)), 1e-12)))
    fit = np.linalg.lstsq(quadratic_terms(grid.centres, grid.shape), circles, rcond=None)[0]
    beam = np.exp(quadratic_surface(fit, grid.shape))
    return compress(np.asarray(picture / beam, dtype=np.float32))


def compress(light: Frame) -> Frame:
    """Light of about 1 in the circles to light / (light + KNEE); what is below zero is dark."""
    positive = np.maximum(light, 0)
    return np.asarray(positive / (positive + np.float32(KNEE)))


def template(grid: FiducialGrid) -> Frame:
    """What `even_picture` shows of a perfectly registered grid without speckle."""
    return compress(np.asarray(cv2.GaussianBlur(grid.image.numpy(), (0, 0), SAMPLE_BLUR)))


def offsets(picture: Frame, grid: FiducialGrid) -> Array:
    """Displacement ``(N, 2)`` [region px] of every circle, by least squares of its patch on the template.

    Gain and offset of every patch are free, so that this is the enhanced correlation coefficient (Evangelidis &
    Psarakis 2008) of a shift, circle by circle. Against an intensity centroid it uses the edge, not the speckle inside.
    """
    reference = template(grid).astype(np.float64)
    slope_y, slope_x = np.gradient(reference)
    patches = _patches(grid)
    model = np.stack([reference, np.ones_like(reference), -slope_x, -slope_y], axis=-1)[patches]
    model = model.reshape(len(grid.centres), -1, 4)
    values = picture.astype(np.float64)[patches].reshape(len(grid.centres), -1, 1)
    normal = model.transpose(0, 2, 1)
    gain, _, x, y = np.linalg.solve(normal @ model, normal @ values)[..., 0].T
    gain = np.maximum(gain, 0.05)
    return np.asarray(np.clip(np.stack([x / gain, y / gain], axis=1), -FURTHEST_CIRCLE, FURTHEST_CIRCLE))


def correlation(picture: Frame, grid: FiducialGrid) -> float:
    """Correlation of the circles and their surroundings with the template; light outside the region has no part."""
    patches = _patches(grid)
    return float(np.corrcoef(picture[patches].ravel(), template(grid)[patches].ravel())[0, 1])


def _patches(grid: FiducialGrid) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Row and column indices ``(N, K, K)`` of a window around every circle that holds no other circle."""
    reach = int(grid.spacing / 2)
    y, x = np.mgrid[-reach : reach + 1, -reach : reach + 1]
    column, row = np.round(grid.centres).astype(np.int64).T[..., None, None]
    return row + y, column + x
