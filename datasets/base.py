"""What every dataset offers, and how an image becomes a target: linear light, cropped to the aspect, resized."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any, ClassVar, Protocol

import numpy as np
import torch
from numpy.typing import NDArray
from PIL import Image
from torch import Tensor

from ..core.errors import UserError, reason, suggest
from ..optics import srgb_decode

LUMINANCE = (0.2126, 0.7152, 0.0722)  # weights of linear R, G, B in relative luminance (ITU-R BT.709-6, section 3.2)

SHOWN = ((256, 256), (144, 256), (256, 144))  # square, wide and tall: an image is cropped to the aspect of its display


class Dataset(Protocol):
    """A source of targets: a frozen dataclass of its parameters.

    Items that are not independent, such as crops of one photograph, have a cluster: ``cluster(item) -> str``. A dataset
    without this method says that each item is a cluster of its own. Intervals and tests are over clusters.

    A dataset of your own is one file with such a class, named in a config as ``path/to/file.py:Class`` or registered
    as an entry point in the group ``holobench_eval.datasets``.

    Attributes
    ----------
    training : bool
        Methods may train on these images, and nothing may score them.
    """

    training: ClassVar[bool]

    def items(self) -> list[str]:
        """List the images.

        Returns
        -------
        list of str
            Unique names in a fixed order.

        Raises
        ------
        UserError
            The source cannot be used.
        """

    def load(self, item: str, shape: tuple[int, int], channels: int = 3) -> Tensor:
        """Load an image as a target.

        Parameters
        ----------
        item : str
            One of `items`.
        shape : tuple of int
            Rows and columns; the image is cropped to this aspect and never stretched.
        channels : {3, 1}
            Red, green and blue, or luminance, see ``with_channels``.

        Returns
        -------
        Tensor
            ``(channels, *shape)`` linear light in [0, 1], float32.
        """

    def digest(self, item: str) -> str:
        """Tell one version of an image from another; a dataset without it is told by pixels, see ``digest_of``.

        Parameters
        ----------
        item : str
            One of `items`.

        Returns
        -------
        str
            SHA-256 (hexadecimal) of what the image is made from; it changes when the image does.
        """


def fit(image: Tensor, shape: tuple[int, int], resampling: Image.Resampling = Image.Resampling.BILINEAR) -> Tensor:
    """Resize the largest centred part of an image that has the aspect of ``shape``; never a stretch.

    The crop is not rounded to pixels, so that both axes are scaled by the same factor exactly. The filter is a
    triangle as wide as two output pixels (two input pixels where the image is too small and has to be enlarged):
    its weights are positive, so nothing rings and the result needs no clipping.

    Parameters
    ----------
    image : Tensor
        ``(C, H, W)`` linear light in [0, 1].
    shape : tuple of int
        Rows and columns ``(h, w)`` of the result.
    resampling : Image.Resampling
        Another of Pillow's filters.

    Returns
    -------
    Tensor
        ``(C, h, w)`` float32 in [0, 1].

    Examples
    --------
    >>> fit(torch.rand(3, 100, 300), (64, 64)).shape
    torch.Size([3, 64, 64])
    """
    rows, columns = shape
    height, width = image.shape[-2:]
    scale = min(height / rows, width / columns)
    top, left = (height - rows * scale) / 2, (width - columns * scale) / 2
    # Rounding must not reach past the border by the last bit, which Pillow refuses.
    box = (max(left, 0.0), max(top, 0.0), min(left + columns * scale, width), min(top + rows * scale, height))
    resized = [
        np.asarray(Image.fromarray(plane).resize((columns, rows), resampling, box=box))
        for plane in image.to(torch.float32).numpy()
    ]
    return torch.from_numpy(np.stack(resized)).clamp_(0.0, 1.0)


def from_srgb(pixels: NDArray[np.uint8] | NDArray[np.uint16]) -> Tensor:
    """Decode sRGB levels.

    Parameters
    ----------
    pixels : ndarray
        ``(H, W)`` or ``(H, W, 3)`` of 8 or 16 bits.

    Returns
    -------
    Tensor
        ``(3, H, W)`` linear light, float32; gray is replicated.
    """
    levels = np.iinfo(pixels.dtype).max + 1
    table = srgb_decode(torch.arange(levels, dtype=torch.float64) / (levels - 1)).float().numpy()
    return planes(table[pixels])


def planes(image: NDArray[np.float32]) -> Tensor:
    """``(H, W)`` or ``(H, W, 3)`` as ``(3, H, W)``; gray is replicated."""
    colour = np.broadcast_to(image[..., None], (*image.shape, 3)) if image.ndim == 2 else image
    return torch.from_numpy(np.ascontiguousarray(colour.transpose(2, 0, 1)))


def with_channels(image: Tensor, channels: int) -> Tensor:
    """Give an image the channels that a target should have.

    Parameters
    ----------
    image : Tensor
        ``(3, h, w)`` linear light.
    channels : {3, 1}
        Three leave it as it is; one makes ``(1, h, w)`` luminance, or takes the colour that alone has light, which is
        then as bright as the same picture in gray. UserError for others.
    """
    if channels == 3:
        return image
    if channels != 1:
        raise UserError(f"a target has 3 channels (R, G, B) or 1 (luminance), not {channels}")
    lit = [plane for plane in image if plane.any()]
    if len(lit) == 1:
        return lit[0][None].clone()
    return torch.einsum("c,chw->hw", torch.tensor(LUMINANCE), image)[None].clamp(0.0, 1.0)


def known(kind: str, item: str, allowed: Sequence[str]) -> str:
    """Return a name if it is allowed.

    Parameters
    ----------
    kind : str
        What it is the name of, for the error: ``"photograph"``.
    item : str
        The name.
    allowed : sequence of str
        The names that there are; the UserError for another one suggests the nearest.
    """
    if item not in allowed:
        raise UserError(f"unknown {kind} '{item}'; {suggest(item, allowed)}")
    return item


def looked_from(path: Path) -> str:
    """Where the search for a relative path of a dataset began, for the error of one that is not there."""
    return "" if path.is_absolute() else f" in the working directory {Path.cwd()}, where paths of images start"


def chosen(kind: str, names: Sequence[str], allowed: Sequence[str]) -> list[str]:
    """The names as a list, each known and given once; UserError for an empty list, an unknown or repeated name."""
    if not names:
        raise UserError(f"the list of {kind}s is empty; allowed: {', '.join(allowed)}")
    for name in names:
        known(kind, name, allowed)
    refuse_repeats(kind, names, "names")
    return list(names)


def refuse_repeats(kind: str, values: Sequence[object], field: str) -> None:
    """UserError for a value that ``field`` lists twice."""
    for index, value in enumerate(values):
        if value in values[:index]:
            raise UserError(f"{kind} '{value}' is given twice in {field}")


def named_digest(*names: object) -> str:
    """Digest an image that is drawn from names alone.

    Parameters
    ----------
    *names
        What the image depends on; one of them is a version of the drawing.

    Returns
    -------
    str
        SHA-256, hexadecimal.
    """
    return hashlib.sha256("\x1f".join(str(name) for name in names).encode()).hexdigest()


def digest_of(dataset: Any, item: str) -> str:
    """SHA-256 of an image: what its dataset says, or of its pixels in the aspects of ``SHOWN``. UserError: it fails."""
    try:
        if hasattr(dataset, "digest"):
            return str(dataset.digest(item))
        images = [dataset.load(item, shape, channels=3).float().cpu().numpy() for shape in SHOWN]
        return hashlib.sha256(b"".join(str(image.shape).encode() + image.tobytes() for image in images)).hexdigest()
    except UserError:
        raise
    except Exception as error:  # of a stranger's dataset
        raise UserError(f"dataset '{type(dataset).__name__}', image '{item}': {reason(error)}") from error


def clusters_of(dataset: Any) -> dict[str, str]:
    """The cluster of every item; empty for a dataset that tells of none."""
    cluster = getattr(dataset, "cluster", None)
    return {item: str(cluster(item)) for item in dataset.items()} if callable(cluster) else {}
