"""Depth-of-field blur of a picture with depth, layer by layer, so that no light bleeds over the edges of things.

After the layered approach of Kraus & Strengert, "Depth-of-field rendering by pyramidal image processing", Computer
Graphics Forum 26(3), 645 (2007), with plain discs in the place of pyramids.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

Image = NDArray[np.float32]


def defocus(image: Image, layers: NDArray[np.integer], radii: Sequence[float]) -> Image:
    """The picture for an eye to which layer ``k`` is blurred by a disc of ``radii[k]`` px.

    image: ``(h, w, C)`` linear light; layers: ``(h, w)`` whole numbers from 0, farthest first. Returns ``(h, w, C)``.

    Layers are blurred one by one and laid over those behind, each with the share of a pixel that it covers. What a
    nearer layer hides of a layer is taken from the nearest pixel that is seen of it, as far as a blurred edge can
    bare it; so a sharp thing in front takes no light from the blurred background, nor the background from it.
    """
    reach = max(radii) + 1
    picture = np.zeros((*image.shape[:2], image.shape[2] + 1), np.float32)
    for layer in np.unique(layers):
        own = layers == layer
        away, (rows, columns) = distance_transform_edt(~own, return_indices=True)
        covered = own | ((layers > layer) & (away <= reach))
        sheet = np.dstack([image[rows, columns], np.ones(own.shape, np.float32)]) * covered[..., None]
        soft = blurred(sheet, radii[layer])
        picture = picture * (1 - soft[..., -1:]) + soft
    return np.asarray(picture[..., :-1] / picture[..., -1:], np.float32)


def blurred(image: Image, radius: float) -> Image:
    """Convolution with a disc, its edge a pixel wide; ``(h, w, C)``, edges repeated beyond the border."""
    if radius <= 0.5:
        return image
    size = math.ceil(radius)
    y, x = np.ogrid[-size : size + 1, -size : size + 1]
    disc = np.clip(radius + 0.5 - np.hypot(y, x), 0, 1)
    soft = cv2.filter2D(image, -1, disc / disc.sum(), borderType=cv2.BORDER_REPLICATE)
    return np.asarray(soft, np.float32).reshape(image.shape)  # OpenCV drops the axis of a single channel
