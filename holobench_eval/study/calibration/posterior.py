"""What published figures leave of a family's parameters, and the displays of it that are kept."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
import yaml
from numpy.typing import NDArray

from ...core.errors import CellError, UserError
from ...core.io import write_atomically
from ...core.seeds import generator
from ...display import Profile
from . import nested, value_of
from .family import DOMAINS, METRICS, Draw, Family, Range, Row, drawn, figures_of, missed, profile_of, solved

QUANTILES = (0.05, 0.5, 0.95)


@dataclass(frozen=True)
class Reading:
    """One way to read the published figures. domain: of the light in which they were computed; metrics: those that are
    held against them; factor: of the tolerances."""

    words: str
    domain: str = "linear"
    metrics: tuple[str, ...] = METRICS
    factor: float = 1.0


READINGS = (
    Reading("in linear light, PSNR and SSIM"),
    Reading("tolerances half as wide", factor=0.5),
    Reading("tolerances twice as wide", factor=2.0),
    Reading("PSNR alone", metrics=("psnr",)),
    Reading("of sRGB values, PSNR and SSIM", domain="srgb"),
    Reading("of sRGB values, PSNR alone", domain="srgb", metrics=("psnr",)),
)
"""The first decides. The paper compares gamma-corrected targets with a linear sensor, and says not in which of the two
its figures were computed."""


@dataclass(frozen=True)
class Marginal:
    """A parameter after the figures. quantiles: 5, 50 and 95 % of its values; width: of the middle half of them,
    relative to that of its range (1: the figures say nothing)."""

    given: Range
    quantiles: tuple[float, float, float]
    width: float


@dataclass(frozen=True)
class Member:
    """A display that is kept. scores: as of ``figures_of``, under its own name and with its own patterns."""

    draw: Draw
    profile: Profile
    scores: Row


def accepted(family: Family, rows: Sequence[Row], reading: Reading = READINGS[0]) -> list[Row]:
    """The draws whose captures have the figures."""
    return [row for row in rows if missed(family, row, reading.domain, reading.metrics) <= reading.factor]


def marginals(family: Family, rows: Sequence[Row]) -> list[Marginal]:
    """Every parameter, the one that the figures determine best first; those of outside effects over the draws that have
    them."""
    found = []
    for given in (*family.parameters, *family.outside.parameters):
        values = np.array([row[given.name] for row in rows])
        values = values[~np.isnan(values)]
        if len(values) > 1:
            low, middle, high = np.quantile(values, QUANTILES).tolist()
            half = float(np.subtract(*np.quantile(values, (0.75, 0.25))))
            found.append(Marginal(given, (low, middle, high), half / (0.5 * (given.high - given.low))))
    return sorted(found, key=lambda one: one.width)


def members(family: Family, name: str, rows: Sequence[Row], folder: Path) -> list[Member]:
    """Displays in a seeded order of the draws that fit, of which as large a share has outside effects as of all draws.

    Each is captured again under its own name, and is kept if it still fits. UserError: too few draws fit.
    """
    fit = accepted(family, rows)
    order = torch.randperm(len(fit), generator=generator("members", family.base, family.seed)).tolist()
    outside = round(family.members * family.outside.share)
    places = {False: family.members - outside, True: outside}
    found = list[Member]()
    for place in order:
        draw = drawn(family, int(fit[place]["draw"]))
        if not places[draw.is_outside]:
            continue
        profile = profile_of(family, draw, f"{name}-{len(found) + 1:02d}")
        try:
            scores = figures_of(family, profile, solved(folder, draw.geometry))
        except CellError:  # not registered with these patterns
            continue
        if missed(family, scores, DOMAINS[0]) <= 1:
            places[draw.is_outside] -= 1
            found.append(Member(draw, profile, scores))
    if any(places.values()):
        lacking = ", ".join(f"{left} {'with' if kind else 'without'} outside effects" for kind, left in places.items())
        raise UserError(f"{len(fit)} of {len(rows)} draws fit, too few: {lacking} more are needed; give more --draws")
    return found


def middle(family: Family, rows: Sequence[Row], found: Sequence[Member]) -> Member:
    """The member nearest to the middle of the draws that fit, of those without outside effects."""
    ranges = {given.name: given.high - given.low for given in family.parameters}
    centre = {name: float(np.median([row[name] for row in accepted(family, rows)])) for name in ranges}

    def distance(member: Member) -> float:
        steps: NDArray[Any] = np.array([(member.draw.values[name] - centre[name]) / ranges[name] for name in ranges])
        return float((steps**2).sum())

    return min((member for member in found if not member.draw.is_outside), key=distance)


def write_member(path: Path, family: Family, member: Member, draws: int) -> None:
    """Write a display's profile. draws: of how many it was chosen."""
    document: dict[str, Any] = {
        "like": family.base,
        "name": member.profile.name,
        "version": 1,
        "seed": member.profile.seed,
        "description": "A display that the paper's could have been"
        + (", with effects that no method's model has." if member.draw.is_outside else "."),
    }
    names = (*family.geometries[member.draw.geometry], *member.draw.values)
    document |= nested({name: value_of(member.profile, name) for name in names})
    reached = ", ".join(
        "{} {:.2f} dB and SSIM {:.3f}".format(method, *(member.scores[f"{method}.{name}_linear"] for name in METRICS))
        for method in family.figures
    )
    head = f"# Draw {member.draw.index} of `holoeval calibrate {family.base} --draws {draws}`, see docs/bench.md.\n"
    head += f"# Captures of its images have {reached}.\n"
    text = yaml.safe_dump(document, sort_keys=False, default_flow_style=None, width=120)
    write_atomically(path, (head + text).encode())
