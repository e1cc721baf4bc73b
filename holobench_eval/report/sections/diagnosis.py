"""What trained methods say of their displays, beside the truth, and what these displays have that no model of them has.

From ``estimates`` and ``missing`` in the provenance of a training (``study.training.diagnosis``).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from ...core.errors import listed
from ...display.estimates import QUANTITIES
from ..data.trainings import Training
from ..markdown import Markdown, bullets, heading, table_of
from ..section import Blocks, Figures, Report, Section
from ..story import is_many

COLOURS = ("red", "green", "blue")
MOST = 1e12  # no quantity is anywhere near; a larger number in a stranger's file is no estimate
Row = Mapping[str, Any]


def _render(report: Report, _: Figures) -> Blocks:
    estimated, lacking = diagnoses(report.trainings), missing(report.trainings)
    if estimated:
        yield heading("Diagnosis", 3)
        yield (
            "Display parameters as the learned models estimate them, in forms that captures determine; in brackets the "
            "ground truth of the simulated bench, which no method sees. The stated error holds for a model that was "
            "trained on patterns that reach every level of the panel."
        )
    for whose, rows, verdict in estimated:
        yield Markdown("**{}.** {}").format(whose, verdict)
        yield rows
    if lacking:
        yield (
            "Effects of the benches that the learned models cannot represent, so that no values of their parameters "
            "describe the display exactly:"
        )
        yield bullets(lacking)


def diagnoses(trainings: Sequence[Training]) -> list[tuple[str, Markdown | None, str]]:
    """Of every training with estimates: whose and of which display, the table, and a sentence on the errors."""
    return [
        (
            item.name if item.name.endswith(f" on {item.display}") else f"{item.name} on {item.display}",
            quantities(rows),
            _verdict(rows),
        )
        for item in trainings
        if (rows := estimates(item))
    ]


def missing(trainings: Sequence[Training]) -> list[str]:
    """For every display, what lies outside the form of the models that were trained on it."""
    lists: dict[tuple[str, tuple[str, ...]], list[str]] = {}
    for item in trainings:
        texts = item.fact("missing")
        if isinstance(texts, list) and all(isinstance(text, str) for text in texts):
            lists.setdefault((item.display, tuple(texts)), []).extend(item.labels)
    return [
        f"{display} contains {'effects' if texts else 'no effect'} that {listed(dict.fromkeys(labels))} cannot "
        f"represent{': ' * bool(texts)}{'; '.join(texts)}."
        for (display, texts), labels in lists.items()
    ]


def estimates(training: Training) -> list[Row]:
    """The estimates of a training; what is no list of them in a stranger's file is none."""
    rows = training.fact("estimates")
    if not isinstance(rows, list):
        return []
    return [row for row in rows if isinstance(row, dict) and _legible(row)]


def _legible(row: Row) -> bool:
    colour = row.get("colour")
    return isinstance(row.get("name"), str) and _known(row.get("value")) and (colour is None or type(colour) is int)


def _known(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and -MOST < value < MOST  # not for NaN


def quantities(rows: Sequence[Row]) -> Markdown | None:
    """A row for every quantity, a column for every colour: the estimate and, in brackets, the truth."""
    colours = sorted({row["colour"] for row in rows if isinstance(row.get("colour"), int)})
    if colours == [0]:  # of the only laser
        rows, colours = [{**row, "colour": None} for row in rows], []
    columns: list[int | None] = [*colours, *([None] if any(row.get("colour") is None for row in rows) else [])]
    told = any(_known(row.get("truth")) for row in rows)
    lines = []
    for name in dict.fromkeys(row["name"] for row in rows):
        same = {row.get("colour"): row for row in rows if row["name"] == name}
        first = next(iter(same.values()))
        words = QUANTITIES[name].words if name in QUANTITIES else name.replace("_", " ")
        off = [abs(difference(row)) for row in same.values() if _known(row.get("truth")) and row.get("seen", True)]
        stated = f"{first['error']:.2g}" if _known(first.get("error")) else "–"
        line = {"quantity": words, "unit": first.get("unit") or ""}
        line |= {_colour(colour): _cell(same[colour], told) if colour in same else "" for colour in columns}
        line["largest difference"] = f"{max(off):.3f}" if off else "–"
        lines.append(line | {"stated error": "not seen" if first.get("seen") is False else stated})
    return table_of(lines)


def _colour(colour: int | None) -> str:
    return "all" if colour is None else dict(enumerate(COLOURS)).get(colour, f"colour {colour}")


def _cell(row: Row, told: bool) -> str:
    """The value; and the truth, where any of the table is told; of what no capture shows, neither."""
    if row.get("seen") is False:
        return "–"
    truth = f"{row['truth']:.3f}" if _known(row.get("truth")) else "–"
    return f"{row['value']:.3f}" + f" ({truth})" * told


def difference(row: Row) -> float:
    """Estimate less truth, phases in rad by the shorter way around."""
    apart = float(row["value"]) - float(row["truth"])
    return math.remainder(apart, math.tau) if row.get("unit") == "rad" else apart


def _verdict(rows: Sequence[Row]) -> str:
    judged = [row for row in rows if _known(row.get("truth")) and _known(row.get("error"))]
    if not judged:
        return "None of these has a ground truth and a stated error to compare with."
    outside = [row for row in judged if abs(difference(row)) > row["error"]]
    if not outside:
        return f"All {len(judged)} numbers are within their stated errors."
    named = ", ".join(dict.fromkeys(row["name"].replace("_", " ") for row in outside))
    return f"{len(judged) - len(outside)} of {len(judged)} numbers are within their stated errors; outside: {named}."


# Of many displays these tables are too long to be read; training/*.json has their numbers.
SECTIONS = (Section("diagnosis", 110, _render, applies=lambda report: not is_many(report.results), details=True),)
