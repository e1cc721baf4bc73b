"""The numbers of the page: those of table.csv and records.csv, with the text that the Markdown shows for each."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from ..charts.look.methods import looks
from ..data.board import GROUPS, board
from ..data.columns import costs
from ..data.phrases import counted
from ..data.results import Results
from ..data.scores import Score
from ..data.statistics import Estimate
from ..data.text import number, p_value
from ..section import Report

Json = dict[str, Any]

TIER, GAIN, P = "tier", "gain", "p"


def page_data(report: Report) -> Json:
    """Everything that the page draws, ready for JSON: no NaN, and numbers rounded as in table.csv."""
    results = report.results
    changed = [name for name in dict.fromkeys(results.table["condition"]) if name in results.layout.changed]
    conditions = [*results.conditions, *changed]
    drawn = board(results)
    tiers = {name: dict[str, str]() for name in conditions}
    tiers |= {display.name: {row.label: row.tier for row in display.rows} for display in drawn.displays}
    return {
        "study": results.layout.title,
        "headline": _score(results.headline),
        "baseline": results.layout.baseline,
        "words": {"scored": results.layout.text.scored, "truth": results.layout.text.truth},
        "displays": results.conditions,
        "changed": changed,
        "columns": list(_columns(results)),
        "scores": [_score(score) for score in results.leading],
        "methods": {name: _method(results, name) for name in _labels(results, conditions)},
        "targets": [
            {"name": target, "cluster": str(cluster)}
            for target, cluster in zip(results.targets, results.clusters, strict=True)
        ],
        "rows": {
            name: [_row(results, label, name, tiers[name].get(label, "")) for label in _ordered(results, name, tiers)]
            for name in conditions
        },
        "values": {
            name: {label: _by_target(results, label, name) for label in results.methods(name)} for name in conditions
        },
        "floors": {
            name: [
                {
                    "name": results.layout.text.floor_name(floor),
                    "mean": _number(results.row(floor, results.reference(name))[column]),
                }
                for floor in results.floors
                if results.has_pictures(name)
            ]
            for column in [results.headline.column]
            for name in results.conditions
        },
    }


def colour(results: Results, label: str) -> str:
    """The colour of a method, ``#rrggbb``, the same as in the figures of the report."""
    return looks(results.names)[label].colour


def _labels(results: Results, conditions: list[str]) -> list[str]:
    return list(dict.fromkeys(label for name in conditions for label in results.methods(name)))


def _ordered(results: Results, condition: str, tiers: dict[str, dict[str, str]]) -> list[str]:
    """Labels in the order of the board, where the condition has one."""
    return list(dict.fromkeys([*tiers[condition], *results.methods(condition)]))


def _method(results: Results, label: str) -> Json:
    registered = results.names[label]
    return {
        "registered": registered,
        "group": GROUPS[results.layout.category(label)],
        "oracle": label in results.layout.privileged,
        "colour": colour(results, label),
    }


def _score(score: Score) -> Json:
    return {
        "key": score.key,
        "title": score.title,
        "heading": score.heading,
        "unit": score.unit,
        "digits": len(score.number(0.0).partition(".")[2]),
        "higher": score.higher_is_better,
    }


def _columns(results: Results) -> Iterator[Json]:
    """Key, heading and direction of every column; the interval and the text of a cell stand in its row."""
    yield {"key": TIER, "heading": "letter", "higher": False}
    for score in results.leading:
        yield {"key": score.key, "heading": score.heading, "higher": score.higher_is_better}
        if score == results.headline and results.layout.baseline is not None:
            heading = f"difference to {results.layout.baseline}{score.brackets}"
            yield {"key": GAIN, "heading": heading, "higher": score.higher_is_better}
            yield {"key": P, "heading": "adjusted p", "higher": False}
    for key, heading in costs(results.table, results.layout.text.each).items():
        yield {"key": key, "heading": heading, "higher": False}


def _row(results: Results, label: str, condition: str, tier: str) -> Json:
    """A row of the table: of every column the value, the interval where there is one, and the text."""
    row = results.row(label, condition)
    cells = {TIER: _cell(tier, float(ord(tier)))} if tier else {}
    cells |= {score.key: _estimate(score, score.of(row)) for score in results.leading}
    gain = results.gain(label, condition)
    if gain is not None and label != results.layout.baseline:
        cells[GAIN] = _estimate(results.headline, gain, signed=True)
        for test in results.against_baseline:
            if (test.condition, test.second) == (condition, label) and not math.isnan(test.p):
                cells[P] = _cell(p_value(test.p).removeprefix("p ").removeprefix("= "), test.p)
    cells |= {key: _cell(number(row[key]), row[key]) for key in costs(results.table, "")}
    return {
        "method": label,
        "marked": counted(results, label, condition),
        "n": int(row["n"]),
        "failed": int(row["failed"]),
        "cells": cells,
    }


def _estimate(score: Score, estimate: Estimate, signed: bool = False) -> Json:
    return _cell(score.estimate(estimate, signed), estimate.mean, estimate.low, estimate.high)


def _cell(text: str, value: float, low: float = math.nan, high: float = math.nan) -> Json:
    ends = {} if math.isnan(low) else {"low": _number(low), "high": _number(high)}
    return {"text": text, "value": _number(value), **ends}


def _by_target(results: Results, label: str, condition: str) -> Json:
    """By score, the value of every target in their order; null for a hole."""
    return {
        score.key: [_number(value) for value in results.values(label, condition, score.key)]
        for score in results.leading
    }


def _number(value: float) -> float | None:
    """Six significant digits, as in table.csv; None for NaN, which JSON has not."""
    return None if math.isnan(value) else float(f"{value:.6g}")
