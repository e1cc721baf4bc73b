"""A generated still life with true depth: patterned balls and pillars on a floor before a wall, ray-traced."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import torch

from ..optics import srgb_decode
from .seeded import Array, Seeded

VERSION = 1  # part of every digest: raise it when the scene is drawn differently

# height of the floor and distance of the wall, with the eye at the origin, y upwards and z away from it
FLOOR, WALL = -1.0, 9.0
NEAREST = 2.25  # the distance that is mapped to the near end of the depth; a strip of floor before it counts as there
BANDS = ((2.4, 2.6), (3.7, 4.0), (7.2, 7.8))  # distances in which objects stand: near, in the middle, far
TILT, HEIGHT = 0.12, 0.75  # how far the middle of the picture lies below the horizon, and its height, at distance 1
LIGHT = np.array([-0.45, 0.75, -0.48]) / np.linalg.norm([-0.45, 0.75, -0.48])
AMBIENT = 0.25  # share of the light that comes from everywhere


class Surface(Protocol):
    """Something that a ray can meet."""

    def distance(self, start: Array, ray: Array) -> Array:
        """How many lengths of ``ray`` ``(3, ...)`` from ``start`` ``(3, ...)`` to the surface; infinite for a miss."""

    def appearance(self, points: Array) -> tuple[Array, Array]:
        """Normals and reflected colours ``(3, n)`` at points ``(3, n)`` of the surface."""


@dataclass(frozen=True)
class Pattern:
    """Two colours ``(3,)`` in turn over coordinates along a surface; kind: checks, stripes, dots or bricks."""

    kind: str
    colours: tuple[Array, Array]
    period: float

    def at(self, u: Array, v: Array) -> Array:
        """Colours ``(3, n)`` at coordinates ``(n,)``."""
        a, b = u / self.period, v / self.period
        if self.kind == "checks":
            second = (np.floor(a) + np.floor(b)) % 2 == 1
        elif self.kind == "stripes":
            second = (a + 0.35 * np.sin(2.1 * b)) % 1 < 0.5
        elif self.kind == "bricks":
            second = (np.abs(2 * b % 1 - 0.5) < 0.4) & (np.abs((a + np.floor(2 * b) / 2) % 1 - 0.5) < 0.45)
        else:
            second = np.hypot(a % 1 - 0.5, b % 1 - 0.5) < 0.33
        first, other = (colour[:, None] for colour in self.colours)
        return np.where(second, other, first)


@dataclass(frozen=True)
class Plane:
    """An endless plane at ``position`` of an axis; its normal points to the eye."""

    axis: int
    position: float
    pattern: Pattern

    def distance(self, start: Array, ray: Array) -> Array:
        """See ``Surface``."""
        with np.errstate(divide="ignore", invalid="ignore"):
            way = (self.position - start[self.axis]) / ray[self.axis]
        return np.where(way > 1e-6, way, np.inf)

    def appearance(self, points: Array) -> tuple[Array, Array]:
        """See ``Surface``."""
        normal = np.zeros_like(points)
        normal[self.axis] = -np.sign(self.position)
        u, v = (points[axis] for axis in range(3) if axis != self.axis)
        return normal, self.pattern.at(u, v)


@dataclass(frozen=True)
class Round:
    """A ball, or with ``upright`` a pillar that ends at its centre's height."""

    centre: Array
    radius: float
    upright: bool
    pattern: Pattern

    def distance(self, start: Array, ray: Array) -> Array:
        """See ``Surface``."""
        axes = [0, 2] if self.upright else [0, 1, 2]
        offset = start[axes] - self.centre[axes].reshape(-1, *[1] * (start.ndim - 1))
        a, b = (ray[axes] ** 2).sum(0), (offset * ray[axes]).sum(0)
        root = b**2 - a * ((offset**2).sum(0) - self.radius**2)
        way = (-b - np.sqrt(np.maximum(root, 0))) / a
        met = (root > 0) & (way > 1e-6)
        if self.upright:
            met &= start[1] + way * ray[1] < self.centre[1]
        return np.where(met, way, np.inf)

    def appearance(self, points: Array) -> tuple[Array, Array]:
        """See ``Surface``."""
        normal = (points - self.centre[:, None]) / self.radius
        if self.upright:
            normal[1] = 0
        around = np.arctan2(normal[0], -normal[2]) * self.radius
        up = points[1] if self.upright else np.arcsin(np.clip(normal[1], -1, 1)) * self.radius
        return normal, self.pattern.at(around, up)


def still_life(name: str, shape: tuple[int, int], parallax: float = 0.0, still: float = 0.0) -> tuple[Array, Array]:
    """Picture ``(h, w, 3)`` linear light in [0, 1] and depth ``(h, w)``, 1 at the near end; ``name`` seeds it.

    Depth is linear in the inverse of the distance, as the focus of an eye is told. parallax: how far the near end moves
    to the left against the far end, in heights of the picture, as the eye moves to the right; what is at the depth
    ``still`` stays. Light that surfaces reflect is that towards the eye in the middle.
    """
    surfaces = _surfaces(name)
    rays = _rays(shape)
    eye = parallax * HEIGHT / (1 / NEAREST - 1 / WALL)
    rays[0] -= eye * (1 / WALL + still * (1 / NEAREST - 1 / WALL))  # an eye moved without turning, its picture shifted
    origin = np.array([eye, 0.0, 0.0]).reshape(3, 1, 1)
    ways = np.stack([surface.distance(origin, rays) for surface in surfaces])
    nearest, way = ways.argmin(0), ways.min(0)
    picture = np.zeros((*shape, 3))
    for index, surface in enumerate(surfaces):
        seen = nearest == index
        points = origin[:, 0] + way[seen] * rays[:, seen]
        picture[seen] = _lit(*surface.appearance(points), points, surfaces[2:]).T
    far, near = 1 / WALL, 1 / NEAREST
    return picture.clip(0, 1), ((1 / way - far) / (near - far)).clip(0, 1)


def _rays(shape: tuple[int, int]) -> Array:
    """``(3, h, w)`` through the middles of pixels, of length 1 along z."""
    rows, columns = shape
    y, x = ((np.arange(size) + 0.5 - size / 2) * HEIGHT / rows for size in (rows, columns))
    across, down = np.meshgrid(x, y)
    return np.stack([across, -down - TILT, np.ones(shape)])


def _lit(normal: Array, colour: Array, points: Array, casting: Sequence[Surface]) -> Array:
    """Light ``(3, n)`` from points: matt, with a small highlight, in the shadow of what stands on the floor."""
    towards = np.einsum("i,in->n", LIGHT, normal)
    ray = np.broadcast_to(LIGHT[:, None], points.shape)
    shadowed = np.zeros(points.shape[1], dtype=bool)
    for surface in casting:
        shadowed |= np.isfinite(surface.distance(points + 1e-3 * normal, ray))
    direct = np.where(shadowed, 0.0, towards.clip(0))
    halfway = LIGHT[:, None] - points / np.linalg.norm(points, axis=0)
    halfway /= np.linalg.norm(halfway, axis=0)
    shine = np.where(direct > 0, np.einsum("in,in->n", normal, halfway).clip(0) ** 40, 0.0)
    return colour * (AMBIENT + (1 - AMBIENT) * direct) + 0.25 * shine


def _surfaces(name: str) -> list[Surface]:
    """Wall and floor, then balls and pillars beside one another, each in one of the bands of depth."""
    draw = Seeded("still life", name)

    def colours(strong: float) -> tuple[Array, Array]:
        """A dark and a light colour of one hue, drawn in sRGB."""
        hue = torch.from_numpy(draw.numbers(3))
        hue = (hue - hue.min()) / (hue.max() - hue.min())
        hue = 1 - strong * (1 - hue)
        return srgb_decode(0.25 * hue).numpy(), srgb_decode(0.45 + 0.5 * hue).numpy()

    surfaces: list[Surface] = [
        Plane(2, WALL, Pattern("bricks", colours(0.6), 0.9)),
        Plane(1, FLOOR, Pattern("checks", colours(0.3), 0.4)),
    ]
    stands = zip((0, 2, 1, 0, 2, 1), ("dots", "stripes", "checks", "stripes", "dots", "checks"), strict=True)
    side = draw.side()
    for index, (band, kind) in enumerate(stands):
        z = draw.number(*BANDS[band])
        upright = kind == "checks"
        radius = draw.number(0.08, 0.11) * z * (0.6 if upright else 1.0)
        x = side * (0.118 * (index - 2.5) + draw.number(-0.02, 0.02)) * z
        top = draw.number(-0.06, 0.0) * z if upright else FLOOR + radius
        pattern = Pattern(kind, colours(0.9), draw.number(0.025, 0.05) * z)
        surfaces.append(Round(np.array([x, top, z]), radius, upright, pattern))
    return surfaces
