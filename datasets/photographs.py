"""The photographs that scikit-image ships inside its package: the images that are scored by default."""

from __future__ import annotations

import hashlib
import io
from dataclasses import dataclass
from functools import cache
from typing import Annotated, ClassVar

import numpy as np
from annotated_types import Interval
from PIL import Image
from torch import Tensor

from ..core.errors import UserError
from .base import chosen, fit, from_srgb, known, shipped, with_channels

# name and file, in the order in which `count` takes them: six in colour, then the gray ones
FILES = {
    "astronaut": "astronaut.png",
    "coffee": "coffee.png",
    "chelsea": "chelsea.png",
    "rocket": "rocket.jpg",
    "hubble_deep_field": "hubble_deep_field.jpg",
    "retina": "retina.jpg",
    "camera": "camera.png",
    "brick": "brick.png",
    "grass": "grass.png",
    "gravel": "gravel.png",
    "text": "text.png",
}


@dataclass(frozen=True)
class Photographs:
    """Photographs that ship inside scikit-image; nothing is downloaded.

    van der Walt et al., "scikit-image: image processing in Python", PeerJ 2:e453, 2014.

    count: the first so many of ``FILES``; None for all. names: these instead, in this order (``count`` is then not
    used). From ``camera`` on the photographs are gray and replicated to three channels. All are decoded as sRGB:
    ``rocket`` carries an Adobe RGB profile, which is ignored, as ``skimage.data`` does. Most have 400 to 512 rows,
    ``chelsea`` 300 and ``text`` 172; a larger region enlarges them.
    """

    count: Annotated[int, Interval(ge=1, le=len(FILES))] | None = 8
    names: tuple[str, ...] | None = None

    training: ClassVar[bool] = False

    def __post_init__(self) -> None:
        """UserError for an unknown or repeated name."""
        if self.names is not None:
            chosen("photograph", self.names, tuple(FILES))

    def items(self) -> list[str]:
        """The names, in order."""
        return list(FILES)[: self.count] if self.names is None else list(self.names)

    def load(self, item: str, shape: tuple[int, int], channels: int = 3) -> Tensor:
        """A photograph as ``(channels, *shape)`` linear light in [0, 1], cropped and resized by ``base.fit``."""
        return with_channels(fit(_decoded(known("photograph", item, self.items())), shape), channels)

    def digest(self, item: str) -> str:
        """SHA-256 of the file inside scikit-image."""
        return _content_digest(known("photograph", item, self.items()))


def _content(name: str) -> bytes:
    content = shipped(FILES[name])
    if content is None:
        raise UserError(f"photograph '{name}' is not in the installed scikit-image; install scikit-image>=0.25")
    return content


@cache
def _content_digest(name: str) -> str:
    return hashlib.sha256(_content(name)).hexdigest()


@cache
def _decoded(name: str) -> Tensor:
    with Image.open(io.BytesIO(_content(name))) as image:
        return from_srgb(np.asarray(image))
