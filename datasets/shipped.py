"""The photographs inside the installed packages, which nothing has to download."""

from __future__ import annotations

import hashlib
import io
from functools import cache
from importlib.resources import files

import numpy as np
from PIL import Image
from torch import Tensor

from ..core.errors import UserError
from .base import from_srgb

SKIMAGE = "skimage/data"
MATPLOTLIB = "matplotlib/mpl-data/sample_data"
PACKAGES = {SKIMAGE: "scikit-image", MATPLOTLIB: "matplotlib"}
# name: file and folder
FILES = {
    "astronaut": ("astronaut.png", SKIMAGE),
    "coffee": ("coffee.png", SKIMAGE),
    "chelsea": ("chelsea.png", SKIMAGE),
    "rocket": ("rocket.jpg", SKIMAGE),
    "hubble_deep_field": ("hubble_deep_field.jpg", SKIMAGE),
    "retina": ("retina.jpg", SKIMAGE),
    "camera": ("camera.png", SKIMAGE),
    "brick": ("brick.png", SKIMAGE),
    "grass": ("grass.png", SKIMAGE),
    "gravel": ("gravel.png", SKIMAGE),
    "text": ("text.png", SKIMAGE),
    "motorcycle": ("motorcycle_left.png", SKIMAGE),
    "coins": ("coins.png", SKIMAGE),
    "moon": ("moon.png", SKIMAGE),
    "ihc": ("ihc.png", SKIMAGE),
    "grace_hopper": ("grace_hopper.jpg", MATPLOTLIB),
}


def shipped(name: str, folder: str = SKIMAGE) -> bytes | None:
    """The contents of a data file inside a package (``folder``: package and folders); None where it has it not.

    ``skimage.data`` looks in a cache first and downloads what it does not find.
    """
    package, *parts = folder.split("/")
    source = files(package).joinpath(*parts, name)
    return source.read_bytes() if source.is_file() else None


def content(name: str) -> bytes:
    """The file of one of ``FILES``. UserError: the installed package has it not."""
    file, folder = FILES[name]
    found = shipped(file, folder)
    if found is None:
        raise UserError(f"photograph '{name}' is not in the installed {PACKAGES[folder]}; leave it out of names")
    return found


@cache
def content_digest(name: str) -> str:
    """SHA-256 of the file of one of ``FILES``."""
    return hashlib.sha256(content(name)).hexdigest()


@cache
def decoded(name: str) -> Tensor:
    """One of ``FILES`` as ``(3, h, w)`` linear light, decoded as sRGB."""
    with Image.open(io.BytesIO(content(name))) as image:
        return from_srgb(np.asarray(image))
