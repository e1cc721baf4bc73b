"""The board of a study: its methods on each display, best first, in groups and tiers, with what each of them cost.

Methods of one group were given as much of the camera and show as many frames. A letter holds the methods of a group
that nothing tells from the best of the letter (``statistics.tiers``). board.json is the board in the numbers of
table.csv; report.md, the page, the site, the terminal and the tables of the documentation are drawn from it.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from ..study.plan import is_reference
from .columns import dictionary
from .facts import CALIBRATED, GIVEN, ONLINE, OPEN_LOOP, ORACLE
from .latex import latex_tables
from .phrases import MARGINS, marks, verdict
from .results import Results, csv_text, to_json
from .scores import Score
from .statistics import Estimate, PairedTest, tiers
from .text import grouped, number

# In the order of the board.
GROUPS = {
    ONLINE: "With photographs of the picture itself",
    CALIBRATED: "With photographs taken in training",
    OPEN_LOOP: "No camera",
    GIVEN: "Photographs that were given",
    ORACLE: "Knows the display: the best phase known",
}
SEVERAL = ", several frames in an exposure"
VERSION = 2


@dataclass(frozen=True)
class Row:
    """A method on a display.

    category: see ``facts``; frames: of a hologram, which share one exposure; tier: its letter (empty: a target is
    missing, there is no test, or it is an oracle); score: mean of the headline with its interval; scored: of how many
    targets; test: against the baseline (None: it is the baseline, or lacks a target); beside: means of other scores;
    photographs: in total, those of its training included; once, each: of its training, and of each target; panel_time:
    frames shown for a picture, photographs included (None: holograms have one frame each); seconds, memory: of one
    hologram, of all processors, memory in MiB (None: unknown); marks: what must be known of it.
    """

    label: str
    category: str
    frames: float
    tier: str
    score: Estimate
    scored: int
    test: PairedTest | None
    beside: tuple[float, ...]
    photographs: float | None
    once: float
    each: float
    panel_time: float | None
    seconds: float | None
    memory: float | None
    marks: tuple[str, ...]

    @property
    def camera(self) -> str:
        """The photographs that it takes, in words: ``62 once``, ``100 a picture``; 0 for none, a dash where unknown."""
        if self.photographs is None:
            return "–"
        counts = ((self.each, "a picture"), (self.once, "once"))
        return " and ".join(f"{number(count)} {how}" for count, how in counts if count) or "0"


@dataclass(frozen=True)
class Display:
    """The methods on a display, by the name of their group, best first; floor: mean of a constant image (or None)."""

    name: str
    groups: tuple[tuple[str, tuple[Row, ...]], ...]
    floor: float | None

    @property
    def rows(self) -> list[Row]:
        """Of all groups."""
        return [row for _, rows in self.groups for row in rows]


@dataclass(frozen=True)
class Board:
    """The displays of a study. results: of the study, with the headline; beside: the scores shown beside it."""

    results: Results
    beside: tuple[Score, ...]
    displays: tuple[Display, ...]

    def marks(self, row: Row) -> list[str]:
        """What must be known of a row, and of how many targets it has a score where that is not all."""
        total = len(self.results.targets)
        return [*row.marks, *([f"{row.scored} of {total} targets"] * (row.scored < total))]

    def as_json(self) -> dict[str, Any]:
        """Ready for JSON: no NaN, and six significant digits as in table.csv."""
        study, score = self.results.study, self.results.headline
        return {
            "board": VERSION,
            "study": study.name,
            "title": study.title,
            "question": study.question,
            "baseline": self.results.baseline,
            "headline": {"key": score.key, "title": score.axis, "unit": score.unit, "higher": score.higher_is_better},
            "targets": len(self.results.targets),
            "clusters": len(set(self.results.clusters)),
            "displays": [
                {
                    "name": display.name,
                    "floor": to_json(display.floor),
                    "groups": [
                        {"name": group, "rows": [self._row(row) for row in rows]} for group, rows in display.groups
                    ],
                }
                for display in self.displays
            ],
        }

    def _row(self, row: Row) -> dict[str, Any]:
        return {
            "method": row.label,
            "title": self.results.facts.of(row.label, "title") or None,
            "registered": self.results.names[row.label],
            "tier": row.tier,
            "targets": row.scored,
            "score": _ends(row.score),
            "difference": _ends(row.test.estimate) | {"p": to_json(row.test.p)} if row.test else None,
            "verdict": verdict(self.results.headline, row.test) if row.test else None,
            "beside": {score.key: to_json(value) for score, value in zip(self.beside, row.beside, strict=True)},
            "photographs": to_json(row.photographs),
            "camera": row.camera,
            "panel_time": to_json(row.panel_time),
            "seconds": to_json(row.seconds),
            "memory_mib": to_json(row.memory),
            "marks": self.marks(row),
        }


def board(results: Results) -> Board:
    """The board of a study: the displays before any change of them."""
    beside = [*results.beside, *results.control]
    beside += [score for score in results.leading[1:] if score.metric == "ssim" and not results.beside]
    return Board(results, tuple(beside), tuple(_display(results, name, tuple(beside)) for name in results.conditions))


def groups_of(results: Results) -> dict[str, str]:
    """The group of each method, by its label, in the order of the board: who was given as much of the camera, and shows
    as many frames in an exposure, which take as many times the panel's time."""
    known = results.frame.groupby("label")["frames"].max() if "frames" in results.frame else pd.Series(dtype=float)
    frames = {str(label): float(count) for label, count in known.items()}
    several = {label: frames.get(label, 1) > 1 for label, name in results.cells if not is_reference(name)}
    return {
        label: f"{name}{SEVERAL * more}"
        for category, name in GROUPS.items()
        for more in (False, True)
        for label in several
        if results.category(label) == category and several[label] == more
    }


def _display(results: Results, condition: str, beside: tuple[Score, ...]) -> Display:
    here = results.methods(condition)
    members = grouped((group, label) for label, group in groups_of(results).items() if label in here)
    ordered = {group: sorted(labels, key=here.index) for group, labels in members.items()}
    groups = tuple((group, tuple(_rows(results, condition, labels, beside))) for group, labels in ordered.items())
    return Display(condition, groups, results.floor(condition))


def _rows(results: Results, condition: str, labels: list[str], beside: tuple[Score, ...]) -> Iterator[Row]:
    complete = [label for label in labels if results.is_complete(label, condition)]
    complete.sort(key=lambda label: -results.headline.sign * _mean(results, label, condition))
    values = np.array([results.values(label, condition) for label in complete])
    margin, most = MARGINS.get(results.headline.unit, (0.0, np.inf))
    letters = dict(zip(complete, tiers(values, margin, most, results.clusters), strict=True))
    for label in [*complete, *(label for label in labels if label not in complete)]:
        row = results.rows[label, condition]
        yield Row(
            label,
            results.category(label),
            float(row.get("frames", 1)),
            letters.get(label, "") if results.category(label) != ORACLE else "",
            results.headline.of(row),
            int(row["n"]),
            results.tested(label, condition),
            tuple(float(row[score.column]) for score in beside),
            _known(row, "total_captures"),
            _known(row, "training_captures") or 0.0,
            _known(row, "captures") or 0.0,
            _known(row, "panel_time"),
            _known(row, "cpu_s"),
            _known(row, "memory_mib"),
            (*marks(results, label, condition), *(["no better than gray"] * is_gray(results, label, condition))),
        )


def is_gray(results: Results, label: str, condition: str) -> bool:
    """Whether the mean of a method is no better than that of a constant image, where one was scored."""
    mean, floor = _mean(results, label, condition), results.floor(condition)
    return floor is not None and math.isfinite(mean) and not results.headline.better(mean, floor)


def _known(row: pd.Series, key: str) -> float | None:
    """A figure of a row of the table; None where it has none."""
    value = float(row.get(key, math.nan))
    return None if math.isnan(value) else value


def _mean(results: Results, label: str, condition: str) -> float:
    return float(results.values(label, condition).mean())


def _ends(estimate: Estimate) -> dict[str, float | None]:
    return {"mean": to_json(estimate.mean), "low": to_json(estimate.low), "high": to_json(estimate.high)}


def texts(results: Results) -> dict[str, str]:
    """The text of each file for programs and papers, by its name."""
    frames = {"records.csv": results.frame, "table.csv": results.table, "tests.csv": results.tests_table}
    drawn = json.dumps(board(results).as_json(), indent=1, ensure_ascii=False, allow_nan=False)
    written = {name: csv_text(frame) for name, frame in frames.items()} | {"board.json": f"{drawn}\n"}
    return written | {"columns.md": f"{dictionary(frames)}\n", "table.tex": latex_tables(results)}
