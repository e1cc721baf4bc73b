"""Light fields: scenes with depth, as an eye sees them whose pupil is at one place of the eyebox after another."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, ClassVar

import torch
from annotated_types import Interval, MinLen
from torch import Tensor

from ..core.errors import UserError
from . import still_life
from .base import known, named_digest, refuse_repeats, with_channels
from .focal_stacks import BLUR, FINE, GENERATED, Plane, generated, refocused

VERSION = 1  # part of every digest: raise it when views are rendered differently

PUPIL = 0.5  # diameter of the eye's pupil, of the iris': that of the condition eye_pupil

Place = Annotated[float, Interval(ge=-1, le=1)]


@dataclass(frozen=True)
class LightFields:
    """Ray-traced scenes with depth, each seen from several places of the eye's pupil: what is near moves, and hides
    other things, as the pupil moves sideways.

    The eye focuses on the image distance of the panel. scenes: ``shapes`` and ``shapes-2``, ``shapes-3`` ... places:
    where the pupil is when a hologram is scored, sideways from the axis in radii of the iris, positive to the right;
    given: where it is in the views that methods are given, by default such that each scored place lies halfway between
    two of these, where nothing holds a picture. near, far: where the two ends of a scene's depth lie, in mm from the
    image distance of the full panel; positive is nearer to the viewer. blur: as in ``focal_stacks``, of the whole iris,
    of which the pupil has half the diameter. While the pupil moves by a radius of the iris, a thing 1 mm away moves by
    half of ``blur``, that of green light for all colours.
    """

    scenes: Annotated[tuple[str, ...], MinLen(1)] = (GENERATED,)
    places: Annotated[tuple[Place, ...], MinLen(1)] = (-0.4375, -0.1875, -0.0625, 0.0625, 0.1875, 0.4375)
    given: Annotated[tuple[Place, ...], MinLen(1)] = (-0.5, -0.375, -0.25, -0.125, 0.0, 0.125, 0.25, 0.375, 0.5)
    near: Plane = 10.0
    far: Plane = -10.0
    blur: Annotated[float, Interval(gt=0, le=1)] = BLUR

    training: ClassVar[bool] = False

    def __post_init__(self) -> None:
        """UserError for a repeated scene or place, one that is not drawn, and for a depth without extent."""
        refuse_repeats("scene", self.scenes, "scenes")
        for field, places in (("places", self.places), ("given", self.given)):
            refuse_repeats("place", [f"{place:g}" for place in places], field)  # as items are named
        if other := [scene for scene in self.scenes if not generated(scene)]:
            raise UserError(f"scene '{other[0]}' has one view; allowed: {GENERATED}, {GENERATED}-2, {GENERATED}-3 ...")
        if self.near <= self.far:
            raise UserError(f"near is to be larger than far, got {self.near:g} and {self.far:g} mm")

    def items(self) -> list[str]:
        """``scene from place``, scene by scene, of the scored places."""
        return [_name(scene, place) for scene, place in itertools.product(self.scenes, self.places)]

    def views(self, item: str) -> list[str]:
        """The views of an item's scene that methods are given, by names as ``items`` has them."""
        return [_name(self.scene(item), place) for place in self.given]

    def load(self, item: str, shape: tuple[int, int], channels: int = 3) -> Tensor:
        """The view from a place, ``(channels, *shape)`` linear light in [0, 1]."""
        scene, place = self._part(item)
        return with_channels(_view(scene, shape, place, (self.far, self.near), self.blur), channels)

    def digest(self, item: str) -> str:
        """SHA-256 of the scene's name, and of how its view is rendered."""
        how = (still_life.VERSION, self.near, self.far, PUPIL, self.blur)
        return named_digest("light field", VERSION, *self._part(item), *how)

    def scene(self, item: str) -> str:
        """The scene of an item: items of a scene are one light field."""
        return self._part(item)[0]

    cluster = scene

    def place(self, item: str) -> float:
        """Of the eye's pupil, sideways from the axis, in radii of the iris."""
        return self._part(item)[1]

    def _parts(self) -> dict[str, tuple[str, float]]:
        """Scene and place of every view."""
        return {_name(*pair): pair for pair in itertools.product(self.scenes, (*self.places, *self.given))}

    def _part(self, item: str) -> tuple[str, float]:
        return self._parts()[known("view", item, list(self._parts()))]


def _name(scene: str, place: float) -> str:
    return f"{scene} from {place:g}"


@lru_cache(maxsize=64)
def _view(scene: str, shape: tuple[int, int], place: float, depth: tuple[float, float], blur: float) -> Tensor:
    far, near = depth
    fine = shape[0] * FINE, shape[1] * FINE
    moved = place * blur / 2 * (near - far)  # of the near end against the far end, in heights
    picture, nearness = still_life.still_life(scene, fine, moved, -far / (near - far))
    light = refocused(picture, nearness, 0.0, depth, blur * PUPIL)[:3]
    return torch.clamp(light, 0, 1)
