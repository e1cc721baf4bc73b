"""Generated scenes: a landscape, a street, things on a table, stones.

A scene is a function of its random numbers and of where its pixels lie, across and up from the middle, in heights of
the picture; it gives light ``(h, w, 3)`` in any unit. What is drawn where never hangs from the last bits of a number.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .seeded import PERIOD, Array, Seeded
from .still_life import Pattern, Plane, Round, Surface


def landscape(draw: Seeded, x: Array, y: Array) -> Array:
    """Hills and rocks of fractal height in the sun, water between them, haze before a sky with clouds."""
    hills, ground, clouds = draw.noise(9, draw.number(0.42, 0.52)), draw.noise(7, 0.65), draw.noise(8, 0.55)
    scale, relief = draw.number(0.35, 0.7), draw.number(0.5, 1.1)
    level = draw.number(-0.9, -0.1) * relief  # of the water
    start = draw.number(0, 60)

    def height(across: Array, away: Array) -> Array:
        return relief * (hills(scale * across + start, scale * away) - 0.25 + 0.04 * away.clip(0, 12))

    eye = float(height(np.zeros(9), np.linspace(0.0, 1.2, 9)).clip(level).max()) + draw.number(0.15, 0.5)
    horizon, azimuth = draw.number(0.0, 0.3), draw.number(0.4, 2.2) * draw.side()
    sun = np.array([np.sin(azimuth), draw.number(0.25, 0.9), np.cos(azimuth)])
    sun /= np.linalg.norm(sun)

    # how high the land at each distance stands in the picture, and the first distance that covers a pixel
    away = np.geomspace(0.2, 40, 600)[:, None]
    covered = np.maximum.accumulate((height(x[:1] * away, away).clip(level) - eye) / away + horizon, axis=0)
    first = np.stack([np.searchsorted(covered[:, column], y[:, column]) for column in range(x.shape[1])], axis=1)
    land = first < len(away)
    after, column = first[land], np.nonzero(land)[1]
    before = np.maximum(after - 1, 0)
    low, high = covered[before, column], covered[after, column]
    share = ((y[land] - low) / np.maximum(high - low, 1e-9)).clip(0, 1)
    z = away[before, 0] + share * (away[after, 0] - away[before, 0])
    across = x[land] * z

    here, step = height(across, z), 0.004 * z
    slopes = (height(across + step, z) - here) / step, (height(across, z + step) - here) / step
    normal = np.stack([-slopes[0], np.ones_like(z), -slopes[1]])
    normal /= np.linalg.norm(normal, axis=0)
    light = np.einsum("i,in->n", sun, normal).clip(0)
    for way in np.geomspace(0.05, 1.5, 6):  # shadows of hills
        above = here + way * sun[1] - height(across + way * sun[0], z + way * sun[2])
        light *= (0.5 + above / (0.3 * way)).clip(0, 1)
    green, earth, rock = (
        draw.colour(0.45, 0.6, draw.number(0.14, 0.36)),
        draw.colour(0.5, 0.5, 0.08),
        draw.colour(0.5, 0.2, 0.08),
    )
    speckle = ground(6 * across, 6 * z)
    grown = (3 * (normal[1] - 0.62) + 0.5 * speckle).clip(0, 1)
    mixed = (0.5 + 0.9 * ground(across + 9, z)).clip(0, 1)
    colour = grown * (mixed * green[:, None] + (1 - mixed) * earth[:, None]) + (1 - grown) * rock[:, None]
    colour = colour * (1 + 0.5 * speckle).clip(0.1)
    snow = (4 * (here / relief - draw.number(0.3, 1.2)) + speckle).clip(0, 1) * (normal[1] > 0.5)
    colour += snow * (0.85 - colour)
    lit = colour * (0.2 * np.array([0.8, 0.95, 1.2])[:, None] + light * np.array([2.6, 2.3, 1.9])[:, None])

    near_sky, far_sky = draw.colour(0.85, draw.number(0.05, 0.3), draw.number(0.05, 0.6)), draw.colour(0.6, 0.5, 0.6)
    up = (y - horizon).clip(0)
    cover = (2.5 * (clouds(2 * x / (up + 0.25), 2 / (up + 0.25)) - draw.number(-0.6, 0.5))).clip(0, 1)[..., None]
    fade = (1 - np.exp(-4 * up))[..., None]
    sky = near_sky * (1 - fade) + far_sky * fade
    sky = sky + cover * (draw.number(0.5, 0.95) * (1 - 0.35 * cover) - 0.7 * sky)
    wet = here < level
    if wet.any():  # the sky at the mirrored height, broken by waves
        ripple = ground(8 * across[wet], 30 * np.log(z[wet]))
        mirrored = (horizon - y[land][wet]) * (1 + 0.5 * ripple) + 0.05 * ripple
        share = (1 - np.exp(-4 * mirrored.clip(0)))[:, None]
        lit[:, wet] = (0.4 * (near_sky * (1 - share) + far_sky * share) * (1 + 0.4 * ripple)[:, None]).T
    haze = np.exp(-z / draw.number(15, 80))
    sky[land] = (haze * lit).T + (1 - haze)[:, None] * near_sky
    return sky


def street(draw: Seeded, x: Array, y: Array) -> Array:
    """Two rows of houses with windows along a street, one of them in the sun."""
    turn, horizon, zoom = draw.number(0.1, 0.75) * draw.side(), draw.number(-0.2, 0.05), draw.number(0.7, 1.1)
    right, up = x / zoom, (y - horizon) / zoom
    ray_x, ray_z = right * np.cos(turn) + np.sin(turn), np.cos(turn) - right * np.sin(turn)
    eye, sides = draw.number(1.6, 5.0), (-draw.number(3, 8), draw.number(3, 8))
    sun = np.array([draw.side() * draw.number(0.4, 1.0), draw.number(0.5, 1.2), draw.number(-0.8, 0.8)])
    sun /= np.linalg.norm(sun)
    grain, stain, clouds = draw.noise(8, 0.6), draw.noise(8, 0.6), draw.noise(7, 0.5)

    blue, white = draw.colour(0.75, draw.number(0.1, 0.5), 0.6), draw.colour(0.95, 0.1, 0.6)
    mix = (up.clip(0) * 1.2 + 0.5 * clouds(2 * ray_x, 3 * up)).clip(0, 1)[..., None]
    picture = white * (1 - mix) + blue * mix

    way = eye / np.maximum(-up, 1e-4)  # to the ground
    across, along = ray_x * way, ray_z * way
    edge = np.minimum(across - sides[0], sides[1] - across)
    road = np.where(edge < 1.6, 0.34, 0.16) * (1 + 0.7 * grain(3 * across, 2 * along)).clip(0.2)
    road = np.where((np.abs(across - sum(sides) / 2) < 0.08) & (along % 5 < 2.5), 0.7, road)
    shaded = (across - sides[0] if sun[0] < 0 else sides[1] - across) < 9 * abs(sun[0]) / sun[1]
    picture[up < 0] = ((road * np.where(shaded, 0.22, 0.22 + 1.4 * sun[1]))[..., None] * draw.colour(0.95, 0.12))[
        up < 0
    ]

    for side, position in zip((-1, 1), sides, strict=True):
        to_wall = position / np.where(side * ray_x > 1e-4, ray_x, side * 1e-4)
        met = (side * ray_x > 1e-4) & ((up >= 0) | (to_wall < way))
        z, height = (to_wall * ray_z)[met], eye + (to_wall * up)[met]
        house = np.searchsorted(-60 + np.cumsum(6 + 9 * draw.numbers(60)), z)
        storey = (2.8 + 0.8 * draw.numbers(61))[house]
        roof = (2 + (4 * draw.numbers(61)).astype(int))[house] * storey + 0.6
        kept = (height < roof) & (np.abs(z) < 400)
        z, height, house, storey, roof = (values[kept] for values in (z, height, house, storey, roof))
        # windows, of one size a house
        column, row = z / (1.6 + 1.4 * draw.numbers(61))[house], height / storey
        off, level = np.abs(column % 1 - 0.5), row % 1
        half, head = (0.18 + 0.14 * draw.numbers(61))[house], (0.75 + 0.15 * draw.numbers(61))[house]
        window = (off < half) & (level > 0.28) & (level < head) & (height < roof - 0.5)
        frame = window & ((half - off < 0.03) | (off < 0.015) | (np.abs(level - 0.6) < 0.012))
        ledge = ((level > 0.23) & (level <= 0.28) & (off < half + 0.05)) | (height > roof - 0.35)
        # walls of plaster or brick, in the sun above the shadow of the houses on the other side
        paints = [draw.colour(draw.number(0.35, 0.9), draw.number(0.05, 0.6), draw.number(0, 0.15)) for _ in range(61)]
        weather = 1 + 0.35 * grain(7 * z, 7 * height) + 0.2 * stain(0.2 * z, 0.2 * height)
        joint = (height % 0.3 < 0.04) | ((z + 0.3 * (np.floor(height / 0.3) % 2)) % 0.6 < 0.04)
        weather *= np.where((draw.numbers(61) < 0.5)[house] & joint, 0.7, 1)
        wall = np.stack(paints)[house] * weather.clip(0.15)[:, None]
        wall = np.where(ledge[:, None], 0.6 * wall + 0.2, wall)
        shade = 9 - (sides[1] - sides[0]) * sun[1] / abs(sun[0]) + 0.4 * stain(0.3 * z, 0 * z)
        light = 0.25 + np.where(height > shade, 1.5 * max(-side * sun[0], 0.0), 0)
        light *= np.where((level > 0.12) & (level <= 0.23) & (off < half), 0.6, 1)  # under a ledge
        pane = (house * 17 + np.floor(column).astype(int) * 7 + np.floor(row).astype(int) * 131) % 997
        glass = draw.numbers(997)[pane]
        mirrored = 0.04 + 0.5 * glass**4 + 0.15 * (stain(z, height) > 0.2) * glass
        shown = np.where(window[:, None], mirrored[:, None] * blue / blue.max(), wall * light[:, None])
        shown = np.where(frame[:, None], 0.6 * light[:, None], shown)
        picture.reshape(-1, 3)[np.flatnonzero(met)[kept]] = shown
    return picture


@dataclass(frozen=True)
class Lid:
    """The round top of a pillar."""

    centre: Array
    radius: float
    colour: Array

    def distance(self, start: Array, ray: Array) -> Array:
        """See ``Surface``."""
        with np.errstate(divide="ignore", invalid="ignore"):
            way = (self.centre[1] - start[1]) / ray[1]
            off = np.hypot(start[0] + way * ray[0] - self.centre[0], start[2] + way * ray[2] - self.centre[2])
        return np.where((way > 1e-6) & (off < self.radius), way, np.inf)

    def appearance(self, points: Array) -> tuple[Array, Array]:
        """See ``Surface``."""
        normal = np.zeros_like(points)
        normal[1] = 1
        return normal, np.broadcast_to(self.colour[:, None], points.shape)


def table(draw: Seeded, x: Array, y: Array) -> Array:
    """Balls and drums of plain and patterned stuff on a table before a wall, with the soft shadows of a lamp."""
    tilt, zoom = draw.number(0.15, 0.7), draw.number(1.3, 2.0)
    rays = np.stack([x / zoom, y / zoom * np.cos(tilt) - np.sin(tilt), np.cos(tilt) + y / zoom * np.sin(tilt)])
    eye, middle = 4.5 * np.sin(tilt) + 0.35, 4.5 * np.cos(tilt)
    lamp = np.array([draw.side() * draw.number(1.5, 4), eye + draw.number(0.2, 3), draw.number(-0.5, 3.5)])
    lamps = lamp + 0.8 * (draw.numbers(5, 3) - 0.5)
    coarse, fine = draw.noise(8, 0.55), draw.noise(8, 0.65)

    def pattern(strength: float, low: float, high: float) -> Pattern:
        """Two colours of nearly one hue, mostly a warm one."""
        light, hue = draw.number(0.35, 0.9), draw.number(-0.05, 0.15) + draw.number() ** 4
        first = draw.colour(light, strength, hue)
        second = draw.colour(light * draw.number(0.55, 1.0), strength, hue + draw.number(-0.2, 0.2))
        kind = ("checks", "stripes", "dots", "bricks")[int(4 * draw.number())]
        return Pattern(kind, (first, second), draw.number(low, high))

    surfaces: list[Surface] = [Plane(2, middle + draw.number(0.6, 3), pattern(0.3, 0.4, 1.5))]
    surfaces.append(Plane(1, -eye, pattern(0.5, 0.4, 1.2)))
    for _ in range(3 + int(5 * draw.number())):
        radius, upright = draw.number(0.15, 0.5), draw.number() < 0.5
        up = draw.number(0.5, 2.2) * radius if upright else radius
        stand = np.array([draw.number(-1.3, 1.3), up - eye, middle + draw.number(-0.9, 0.6)])
        surfaces.append(Round(stand, radius, upright, pattern(draw.number(0.1, 0.9), 0.1, 0.5)))
        if upright:
            surfaces.append(Lid(stand, radius, draw.colour(draw.number(0.3, 0.9), 0.3)))
    ways = np.stack([surface.distance(np.zeros((3, 1, 1)), rays) for surface in surfaces])
    nearest, way = ways.argmin(0), ways.min(0)
    picture = np.zeros((*x.shape, 3))
    shine = draw.numbers(len(surfaces)) ** 2
    for index, surface in enumerate(surfaces):
        seen = nearest == index
        points = way[seen] * rays[:, seen]
        normal, colour = surface.appearance(points)
        a, b, c = points + index
        texture = 0.2 * coarse(4 * a, 4 * (b + c)) + 0.25 * fine(7 * a + b, 7 * (c - b))
        colour = colour * (1 + texture).clip(0.1)
        light = 0.12 * colour * (0.6 + 0.4 * normal[1])
        for source in lamps:
            towards = source[:, None] - points
            far = np.linalg.norm(towards, axis=0)
            towards /= far
            facing = (towards * normal).sum(0).clip(0)
            for other in surfaces[2:]:
                facing *= other.distance(points + 1e-3 * normal, towards) > far
            halfway = towards - points / np.linalg.norm(points, axis=0)
            gloss = ((halfway * normal).sum(0).clip(0) / np.linalg.norm(halfway, axis=0)) ** 50 * (facing > 0)
            light += 9 / len(lamps) / far**2 * (colour * facing + 0.5 * shine[index] * gloss)
        picture[seen] = light.T
    return picture


def stones(draw: Seeded, x: Array, y: Array) -> Array:
    """Stones of two sizes and the sand between them from above, in a low sun."""
    size, turn = draw.number(3, 7), draw.number(0, 6.28)
    sites = draw.numbers(2, PERIOD, PERIOD, 2) * 0.7 + 0.15
    girths, heights = 0.3 + 0.22 * draw.numbers(2, PERIOD, PERIOD), 0.2 + 0.5 * draw.numbers(2, PERIOD, PERIOD)
    rough, sand = draw.noise(4, 0.5), draw.noise(5, 0.7)
    bump = draw.number(0.05, 0.2)

    def surface(u: Array, v: Array) -> tuple[Array, NDArray[np.int64]]:
        """Height, and which stone: 0 for sand."""
        bent = u + 0.25 * rough(u, v), v + 0.25 * rough(v + 7, u)
        top, stone = 0.03 * sand(6 * u, 6 * v), np.zeros_like(u, dtype=np.int64)
        for layer, fine in enumerate((1.0, 2.7)):
            i, j = np.floor(fine * bent[0]).astype(np.int64), np.floor(fine * bent[1]).astype(np.int64)
            for near_i, near_j in ((i + a, j + b) for a in (-1, 0, 1) for b in (-1, 0, 1)):
                cell = near_i % PERIOD, near_j % PERIOD
                site, girth = sites[layer][cell], girths[layer][cell]
                off = np.hypot(fine * bent[0] - near_i - site[..., 0], fine * bent[1] - near_j - site[..., 1]) / girth
                dome = heights[layer][cell] * girth * np.sqrt((1 - off**4).clip(0)) / fine
                above = (off < 1) & (dome > top)
                top = np.where(above, dome, top)
                stone = np.where(above, 1 + (cell[0] + PERIOD * cell[1] + 31 * layer), stone)
        return top + np.where(stone > 0, 0.15 * bump * rough(3 * u, 3 * v), 0), stone

    u, v = size * (np.cos(turn) * x - np.sin(turn) * y) + 20, size * (np.sin(turn) * x + np.cos(turn) * y) + 20
    sun = np.array([0.8, 0.0, draw.number(0.35, 0.9)])
    sun /= np.linalg.norm(sun)
    here, stone = surface(u, v)
    down, right = (gradient * len(x) / size for gradient in np.gradient(here))
    slopes = np.cos(turn) * right + np.sin(turn) * down, np.cos(turn) * down - np.sin(turn) * right
    light = ((sun[2] - slopes[0] * sun[0]) / np.sqrt(1 + slopes[0] ** 2 + slopes[1] ** 2)).clip(0)
    for way in (0.07, 0.16, 0.35):
        light *= (1 + (here + way * sun[2] - surface(u + way * sun[0], v)[0]) / 0.04).clip(0, 1)
    hue = draw.number(0.0, 0.15)
    kinds = np.stack([draw.colour(draw.number(0.3, 0.85), draw.number(0.05, 0.45), hue) for _ in range(12)])
    sandy = draw.colour(draw.number(0.3, 0.7), 0.3, 0.09)
    colour = np.where(stone[..., None] > 0, kinds[stone * 7 % 12], sandy)
    colour = colour * (1 + 0.5 * sand(2 * u + stone, 2 * v))[..., None].clip(0.1)
    return colour * (0.15 + light)[..., None]
