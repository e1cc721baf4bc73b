"""Focal stacks: pictures with depth, as an eye sees them that focuses on one plane after another (paper 7.1)."""

from __future__ import annotations

import hashlib
import io
import itertools
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Annotated, ClassVar

import numpy as np
import torch
from annotated_types import Interval, MinLen
from numpy.typing import NDArray
from PIL import Image
from torch import Tensor

from ..core.errors import PictureError, UserError, suggest
from ..core.pictures import open_picture
from . import still_life
from .base import fit, from_srgb, known, named_digest, refuse_repeats, with_channels
from .defocus import defocus
from .images import decode, read
from .shipped import shipped

VERSION = 1  # part of every digest: raise it when stacks are rendered differently

# diameter of the circle of confusion for 1 mm of defocus, as a share of the picture's height. The iris of the
# displays passes 0.8 of the panel's band, a cone of 0.8 x 517 nm / 6.4 um = 0.0646 rad from edge to edge, so that 1
# mm out of focus a point is a disc of 0.0646 mm, and the scored window of the full panel is 0.8125 x 1080 x 6.4 um =
# 5.616 mm high. On a smaller panel both lengths shrink with its rows. It is that of green light for all colours.
BLUR = 0.0115

LAYERS = 25  # depths that are blurred apart, evenly from far to near: a step is a sixth of a millimetre by default

FINE = 2  # samples a pixel and axis while a stack is rendered, so that edges are smooth

SMALL = (48, 64)  # shape of the picture by which an item is checked to have something in focus

GENERATED = "shapes"
MOTORCYCLE = "motorcycle_left.png", "motorcycle_disp.npz"

Array = NDArray[np.floating]

Plane = Annotated[float, Interval(ge=-50, le=50)]


@dataclass(frozen=True)
class FocalStacks:
    """Scenes with depth, each rendered for an eye that focuses on several planes, with depth-of-field blur.

    scenes: ``shapes`` and ``shapes-2``, ``shapes-3`` ... are generated; ``motorcycle`` is the stereo pair of
    scikit-image with its true disparity (Scharstein et al., "High-resolution stereo datasets with subpixel-accurate
    ground truth", GCPR 2014); a path is a folder with ``image.png`` (8-bit sRGB) and ``depth.png`` of the same size
    (gray, 8 or 16 bit, bright is near, linear in inverse distance, as disparity is), from the working directory.
    planes: where the eye focuses, in mm from the image distance of the full panel; positive is farther from the panel
    and nearer to the viewer. near, far: where the two ends of a scene's depth lie [mm]. in_focus: how far from a plane
    things still count as in focus [mm]. blur: diameter of the disc that a point becomes 1 mm out of focus, as a share
    of the picture's height; 0.0115 is that of an iris of 0.8 of the band, pixels of 6.4 um and green light, and other
    optics have another one.
    """

    scenes: Annotated[tuple[str, ...], MinLen(1)] = (GENERATED,)
    planes: Annotated[tuple[Plane, ...], MinLen(1)] = (-2.0, 0.0, 2.0)
    near: Plane = 2.0
    far: Plane = -2.0
    in_focus: Annotated[float, Interval(gt=0, le=50)] = 0.5
    blur: Annotated[float, Interval(gt=0, le=1)] = BLUR

    training: ClassVar[bool] = False

    def __post_init__(self) -> None:
        """UserError for a repeated scene or plane, and for a depth without extent."""
        refuse_repeats("scene", [_title(name) for name in self.scenes], "scenes")
        refuse_repeats("plane", self.planes, "planes")
        if self.near <= self.far:
            raise UserError(f"near is to be larger than far, got {self.near:g} and {self.far:g} mm")

    def items(self) -> list[str]:
        """``scene@plane``, scene by scene. UserError for a scene that cannot be had, or has nothing at a plane."""
        for item in self._parts():
            self.digest(item)
            if not self.mask(item, SMALL).any():
                scene, plane = self._parts()[item]
                reach = f"within {self.in_focus:g} mm of the plane at {plane:g} mm"
                raise UserError(
                    f"scene '{scene}' has nothing {reach}; its depth goes from {self.far:g} to {self.near:g} mm"
                )
        return list(self._parts())

    def load(self, item: str, shape: tuple[int, int], channels: int = 3) -> Tensor:
        """The scene with the plane in focus, ``(channels, *shape)`` linear light in [0, 1]."""
        return with_channels(self._rendered(item, shape)[:3].clamp(0, 1).clone(), channels)

    def digest(self, item: str) -> str:
        """SHA-256 of the scene's files or name, and of how it is rendered."""
        scene, plane = self._part(item)
        how = (plane, self.near, self.far, self.in_focus, self.blur)
        return named_digest("focal stack", VERSION, _digest(scene), *how)

    def scene(self, item: str) -> str:
        """The scene of an item: items of a scene are one stack."""
        return _title(self._part(item)[0])

    cluster = scene

    def plane(self, item: str) -> float:
        """Where the eye focuses [mm], on the full panel."""
        return self._part(item)[1]

    def mask(self, item: str, shape: tuple[int, int]) -> Tensor:
        """Where more than half of what is seen is in focus, ``shape``, bool."""
        return self._rendered(item, shape)[3] > 0.5

    def _parts(self) -> dict[str, tuple[str, float]]:
        """Scene as given, and plane, of every item."""
        pairs = itertools.product(self.scenes, self.planes)
        return {f"{_title(scene)}@{plane:g}mm": (scene, plane) for scene, plane in pairs}

    def _part(self, item: str) -> tuple[str, float]:
        return self._parts()[known("focal stack", item, list(self._parts()))]

    def _rendered(self, item: str, shape: tuple[int, int]) -> Tensor:
        scene, plane = self._part(item)
        return _render(scene, _digest(scene), shape, plane, (self.far, self.near), self.in_focus, self.blur)


@lru_cache(maxsize=64)
def _render(
    scene: str,
    _digest: str,
    shape: tuple[int, int],
    plane: float,
    depth: tuple[float, float],
    in_focus: float,
    blur: float,
) -> Tensor:
    """``(4, *shape)``: linear light, and the share of it that is in focus."""
    return refocused(*_source(scene)((shape[0] * FINE, shape[1] * FINE)), plane, depth, blur, in_focus)


def refocused(
    picture: Array, nearness: Array, plane: float, depth: tuple[float, float], blur: float, in_focus: float = 0.0
) -> Tensor:
    """``(4, h, w)``: linear light for an eye that focuses on a plane [mm], and the share of it that is in focus.

    picture, nearness: ``(FINE h, FINE w, 3)`` and ``(FINE h, FINE w)``, see ``Source``; depth: far and near end [mm];
    blur: as in ``FocalStacks``; in_focus: how far from the plane counts as in focus [mm].
    """
    layers = np.rint(nearness * (LAYERS - 1)).astype(np.int64)
    away = np.abs(np.linspace(*depth, LAYERS) - plane)
    sharp = (away <= in_focus + 1e-9)[layers]
    radii = (away * blur * len(picture) / 2).tolist()
    fine = defocus(np.dstack([picture, sharp]).astype(np.float32), layers, radii)
    return torch.nn.functional.avg_pool2d(torch.from_numpy(fine).permute(2, 0, 1), FINE)


# A picture `(h, w, 3)` in linear light and its nearness `(h, w)` from 0, far, to 1, near, for a shape
Source = Callable[[tuple[int, int]], tuple[Array, Array]]


def _title(scene: str) -> str:
    """The name of a scene in items: its own, or that of its folder."""
    return Path(scene).name or scene


def generated(scene: str) -> bool:
    """Whether a scene is one of those that are drawn."""
    number = scene.removeprefix(f"{GENERATED}-")
    return scene == GENERATED or (number != scene and number.isdecimal())


def _source(scene: str) -> Source:
    if generated(scene):
        return lambda shape: still_life.still_life(scene, shape)
    picture, nearness = _read(scene, _digest(scene))

    def fitted(shape: tuple[int, int]) -> tuple[Array, Array]:
        # Depths are taken from the nearest pixel: between near and far there is nothing at an edge.
        depth = fit(nearness[None], shape, Image.Resampling.NEAREST)[0]
        return fit(picture, shape).permute(1, 2, 0).numpy(), depth.numpy()

    return fitted


def _digest(scene: str) -> str:
    """SHA-256 of what a scene is made from."""
    if generated(scene):
        return named_digest(scene, still_life.VERSION)
    return hashlib.sha256(b"".join(hashlib.sha256(content).digest() for content in _files(scene))).hexdigest()


@lru_cache(maxsize=8)
def _read(scene: str, _digest: str) -> tuple[Tensor, Tensor]:
    """Picture ``(3, H, W)`` and nearness ``(H, W)`` of a scene that is kept in files."""
    content, depth = _files(scene)
    if scene == "motorcycle":
        with Image.open(io.BytesIO(content)) as image:
            picture = from_srgb(np.asarray(image))
        with np.load(io.BytesIO(depth)) as arrays:
            nearness = _without_holes(arrays["arr_0"].astype(np.float64))
    else:
        picture = decode(content, f"{scene}/image.png")
        nearness = _depth_levels(depth, f"{scene}/depth.png")
    if picture.shape[1:] != nearness.shape:
        sizes = " and ".join(f"{size[1]} x {size[0]}" for size in (picture.shape[1:], nearness.shape))
        raise UserError(f"{scene}: image and depth are {sizes} pixels; expected one size")
    low, high = float(nearness.min()), float(nearness.max())
    if low == high:
        raise UserError(f"{scene}: its depth is the same everywhere; a scene has something near and something far")
    return picture, torch.from_numpy(((nearness - low) / (high - low)).astype(np.float32))


def _files(scene: str) -> tuple[bytes, bytes]:
    """Contents of the picture and of the depth. UserError says what is missing and how to get it."""
    if scene == "motorcycle":
        picture, disparity = (shipped(name) for name in MOTORCYCLE)
        if picture is None or disparity is None:
            lacking = [name for name, part in zip(MOTORCYCLE, (picture, disparity), strict=True) if part is None]
            raise UserError(
                f"scene 'motorcycle': {' and '.join(lacking)} not in the installed scikit-image; "
                "install scikit-image 0.26.0, whose wheel has both, or leave the scene out"
            )
        return picture, disparity
    if not Path(scene).is_dir():
        near = suggest(scene, [GENERATED, f"{GENERATED}-2", "motorcycle"])
        raise UserError(f"unknown scene '{scene}'; {near}, or a folder with image.png and depth.png")
    if not Path(scene, "depth.png").is_file():
        raise UserError(
            f"{scene}/depth.png: no such file; expected a gray PNG of 8 or 16 bits, bright where it is near"
        )
    return read(Path(scene, "image.png")), read(Path(scene, "depth.png"))


def _depth_levels(content: bytes, name: str) -> NDArray[np.float64]:
    right = "expected a gray PNG of 8 or 16 bits, bright where it is near"
    try:
        stored = open_picture(content)
        if (stored.format, stored.channels) != ("PNG", 1) or stored.has_alpha or stored.bits < 8:
            raise PictureError("another kind of image")
        return stored.upright().astype(np.float64)
    except PictureError as error:
        raise UserError(f"{name}: {right} ({error})") from error


def _without_holes(disparity: NDArray[np.float64]) -> NDArray[np.float64]:
    """Holes of a disparity map get the smaller of the values at both their ends in the row: what only one camera sees
    belongs to the background."""
    filled = []
    for view in (disparity, disparity[:, ::-1]):
        columns = np.where(np.isfinite(view), np.arange(view.shape[1]), 0)
        last = np.maximum.accumulate(columns, axis=1)
        filled.append(np.take_along_axis(view, last, axis=1))
    both = np.fmin(filled[0], filled[1][:, ::-1])
    return np.where(np.isfinite(both), both, np.nanmin(disparity))
