"""The report of a family of displays: what published figures determine, and the displays that are kept."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

from ..core.io import write_atomically
from ..study.calibration.family import DOMAINS, METRICS, Family, Row, missed
from ..study.calibration.posterior import READINGS, Marginal, Member, accepted, marginals
from .charts.family import draw_corner
from .markdown import Markdown, blocks, bullets, code, heading, table

SHOWN = 6  # parameters of the picture
NARROW, WIDE = 0.7, 0.9  # of a parameter's range: determined, and not
CUT = 0.1  # of its range: a quantile so near to an end is that of the range, and not of the figures


def write_family(folder: Path, family: Family, rows: Sequence[Row], found: Sequence[Member], nearest: Member) -> Path:
    """Write ``report.md`` and its picture; returns the path of the former."""
    fit = accepted(family, rows)
    order = marginals(family, fit)
    shown = [one.given for one in order if one.given in family.parameters][:SHOWN]
    draw_corner(folder / "corner.png", shown, rows, fit)
    path = folder / "report.md"
    text = blocks(
        [
            heading(f"Displays with the figures of {family.base}", 1),
            _answer(family, rows, fit, order),
            Markdown("![Pairs of parameters](corner.png)"),
            f"All {len(rows)} draws pale, those that fit dark; dotted: an even spread. The {SHOWN} parameters that the "
            "figures determine best.",
            heading("What the figures determine"),
            _marginals(order),
            _geometries(family, rows, fit),
            heading("Other ways to read the figures"),
            _readings(family, rows),
            heading("The displays that are kept"),
            "Drawn in a seeded order from those that fit, and captured again under their own names. "
            f"{nearest.profile.name} is the nearest to the middle of those that fit.",
            _members(family, found),
        ]
    )
    write_atomically(path, f"{text}\n".encode())
    return path


def _answer(family: Family, rows: Sequence[Row], fit: Sequence[Row], order: Sequence[Marginal]) -> Markdown:
    figures = ", ".join(
        f"{method} {values['psnr']:g} dB and SSIM {values['ssim']:g}" for method, values in family.figures.items()
    )
    refused = sum(missed(family, row, DOMAINS[0]) == math.inf for row in rows)
    known = [_range(one) for one in order if one.width < NARROW]
    unknown = [one.given.words for one in order if one.width > WIDE]
    return bullets(
        [
            f"Captures of {len(fit)} of {len(rows)} draws ({len(fit) / len(rows):.0%}) have the published figures: "
            f"{figures}, within {family.tolerance['psnr']:g} dB and {family.tolerance['ssim']:g}.",
            f"{refused} draws could not be registered.",
            f"The figures determine {'; '.join(known) or 'no parameter'}.",
            f"They say next to nothing of: {', '.join(unknown) or 'no parameter'}.",
        ]
    )


def _range(one: Marginal) -> str:
    near = CUT * (one.given.high - one.given.low)
    ends = [
        end
        for end, value in ((one.given.low, one.quantiles[0]), (one.given.high, one.quantiles[2]))
        if abs(end - value) < near
    ]
    cut = f" (cut where its range ends, at {' and '.join(f'{end:g}' for end in ends)})" if ends else ""
    return f"{one.given.words}: {_span(one)} {one.given.unit}".rstrip() + cut


def _span(one: Marginal) -> str:
    low, _, high = one.quantiles
    return f"{low:.3g} to {high:.3g}"


def _marginals(order: Sequence[Marginal]) -> Markdown:
    head = ["parameter", "key", "unit", "drawn from", "5 %", "median", "95 %", "width of the middle half", "source"]
    lines = [
        [
            one.given.words,
            code(one.given.name),
            one.given.unit,
            f"{one.given.low:g} to {one.given.high:g}",
            *(f"{value:.3g}" for value in one.quantiles),
            f"{one.width:.2f}",
            one.given.source,
        ]
        for one in order
    ]
    return blocks([table(head, lines), "The width is relative to that of the range: at 1 the figures say nothing."])


def _geometries(family: Family, rows: Sequence[Row], fit: Sequence[Row]) -> Markdown:
    lines = []
    for number, given in enumerate(family.geometries):
        drawn, kept = (sum(row["geometry"] == number for row in some) for some in (rows, fit))
        lines.append([number + 1, ", ".join(f"{name} {value}" for name, value in given.items()), drawn, kept])
    return table(["geometry", "what methods are told", "draws", "draws that fit"], lines)


def _readings(family: Family, rows: Sequence[Row]) -> Markdown:
    first = [one.given for one in marginals(family, accepted(family, rows))[:2]]
    lines = []
    for reading in READINGS:
        fit = accepted(family, rows, reading)
        found = {one.given.name: _span(one) for one in marginals(family, fit)} if len(fit) > 1 else {}
        lines.append([reading.words, len(fit), *(found.get(given.name, "–") for given in first)])
    heads = [f"{given.words}, 5 to 95 % [{given.unit}]" for given in first]
    return table(["figures held against captures", "draws that fit", *heads], lines)


def _members(family: Family, found: Sequence[Member]) -> Markdown:
    scores = [f"{method}.{metric}_{DOMAINS[0]}" for method in family.figures for metric in METRICS]
    heads = [
        f"{method} {metric.upper()}{' [dB]' * (metric == 'psnr')}" for method in family.figures for metric in METRICS
    ]
    lines = [
        [
            member.profile.name,
            member.draw.index,
            member.draw.geometry + 1,
            "yes" if member.draw.is_outside else "",
            *(f"{member.scores[name]:.3g}" if "ssim" in name else f"{member.scores[name]:.2f}" for name in scores),
        ]
        for member in found
    ]
    return table(["display", "draw", "geometry", "outside effects", *heads], lines)
