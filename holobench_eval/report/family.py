"""The report of a family of displays: what published figures determine, and the displays that are kept."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

from ..core.io import write_atomically
from ..study.calibration.family import DOMAINS, METRICS, Family, Row, missed
from ..study.calibration.posterior import READINGS, Marginal, Member, accepted, marginals
from .charts.family import draw_corner
from .markdown import Markdown, blocks, bullets, code, heading, table_of

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
            "The width is relative to that of the range: at 1 the figures say nothing.",
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
            f"Captures of {len(fit)} of {len(rows)} draws ({len(fit) / len(rows):.0%}) come within "
            f"{family.tolerance['psnr']:g} dB and {family.tolerance['ssim']:g} of the published figures: {figures}.",
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


def _marginals(order: Sequence[Marginal]) -> Markdown | None:
    return table_of(
        [
            {
                "parameter": one.given.words,
                "key": code(one.given.name),
                "unit": one.given.unit,
                "drawn from": f"{one.given.low:g} to {one.given.high:g}",
                **dict(zip(("5 %", "median", "95 %"), (f"{value:.3g}" for value in one.quantiles), strict=True)),
                "width of the middle half": f"{one.width:.2f}",
                "source": one.given.source,
            }
            for one in order
        ]
    )


def _geometries(family: Family, rows: Sequence[Row], fit: Sequence[Row]) -> Markdown | None:
    lines = []
    for number, given in enumerate(family.geometries):
        drawn, kept = (sum(row["geometry"] == number for row in some) for some in (rows, fit))
        line = {"geometry": number + 1, "what methods are told": ", ".join(f"{k} {v}" for k, v in given.items())}
        lines.append(line | {"draws": drawn, "draws that fit": kept})
    return table_of(lines)


def _readings(family: Family, rows: Sequence[Row]) -> Markdown | None:
    first = [one.given for one in marginals(family, accepted(family, rows))[:2]]
    lines = []
    for reading in READINGS:
        fit = accepted(family, rows, reading)
        found = {one.given.name: _span(one) for one in marginals(family, fit)} if len(fit) > 1 else {}
        line: dict[str, object] = {"figures held against captures": reading.words, "draws that fit": len(fit)}
        spans = {f"{given.words}, 5 to 95 % [{given.unit}]": found.get(given.name, "–") for given in first}
        lines.append(line | spans)
    return table_of(lines)


def _members(family: Family, found: Sequence[Member]) -> Markdown | None:
    lines = []
    for member in found:
        line = {"display": member.profile.name, "draw": member.draw.index, "geometry": member.draw.geometry + 1}
        line |= {"outside effects": "yes" if member.draw.is_outside else ""}
        for method in family.figures:
            psnr, ssim = (member.scores[f"{method}.{metric}_{DOMAINS[0]}"] for metric in METRICS)
            line |= {f"{method} PSNR [dB]": f"{psnr:.2f}", f"{method} SSIM": f"{ssim:.3g}"}
        lines.append(line)
    return table_of(lines)
