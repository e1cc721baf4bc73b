"""The numbers of the page: those of table.csv and records.csv, with the text that the Markdown shows for each."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from matplotlib import colormaps

from ..board import GROUPS, board
from ..charts.look import looks
from ..columns import costs
from ..phrases import counted, verdict
from ..results import Results, to_json
from ..scores import Score
from ..statistics import Estimate
from ..story import Report
from ..text import number

Json = dict[str, Any]

TIER, GAIN, P = "tier", "gain", "p"


def page_data(report: Report) -> Json:
    """Everything that the page draws, ready for JSON: no NaN, and numbers rounded as in table.csv."""
    results, text = report.results, report.results.text
    tiers = {display.name: {row.label: row.tier for row in display.rows} for display in board(results).displays}
    tiers |= {name: dict.fromkeys(results.methods(name), "") for name in results.changed}
    colours, column = looks(results.names), results.headline.column
    return {
        "headline": _score(results.headline),
        "baseline": results.baseline,
        "words": {"scored": text.scored, "truth": text.truth},
        "displays": results.conditions,
        "changed": results.changed,
        "columns": list(_columns(results)),
        "scores": [_score(score) for score in results.leading],
        "methods": {
            label: {
                "registered": results.names[label],
                "group": GROUPS[results.category(label)],
                "oracle": label in results.facts.oracles,
                "colour": colours[label].colour,  # the same as in the figures
            }
            for label in dict.fromkeys(label for labels in tiers.values() for label in labels)
        },
        "targets": results.targets,
        "rows": {
            name: [_row(results, label, name, tier) for label, tier in labels.items()] for name, labels in tiers.items()
        },
        "values": {
            name: {label: _by_target(results, label, name) for label in labels} for name, labels in tiers.items()
        },
        "floors": {
            name: [
                {"name": text.floor_name(floor), "mean": to_json(results.rows[floor, results.reference(name)][column])}
                for floor in results.floors
                if results.has_pictures(name)
            ]
            for name in results.conditions
        },
        "magma": colormaps["magma"](range(256), bytes=True)[:, :3].tolist(),
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
        if score == results.headline and results.baseline is not None:
            heading = f"difference to {results.baseline}{score.brackets}"
            yield {"key": GAIN, "heading": heading, "higher": score.higher_is_better}
            yield {"key": P, "heading": "adjusted p", "higher": False}
    for key, heading in costs(results.table, results.text.each).items():
        yield {"key": key, "heading": heading, "higher": False}


def _row(results: Results, label: str, condition: str, tier: str) -> Json:
    """A row of the table: of every column the value, the interval where there is one, and the text."""
    row, gain = results.rows[label, condition], results.gain(label, condition)
    test = results.tested(label, condition)
    cells = {TIER: _cell(tier, float(ord(tier)))} if tier else {}
    cells |= {score.key: _estimate(score, score.of(row)) for score in results.leading}
    if gain is not None and label != results.baseline:
        cells[GAIN] = _estimate(results.headline, gain, signed=True)
    if test and not math.isnan(test.p):
        cells[P] = _cell("< 0.001" if test.p < 0.001 else f"{test.p:.3f}", test.p)
    cells |= {key: _cell(number(row[key]), row[key]) for key in costs(results.table, "")}
    return {
        "method": label,
        "marked": counted(results, label, condition),
        "verdict": verdict(results.headline, test) if test else "",
        "cells": cells,
    }


def _estimate(score: Score, estimate: Estimate, signed: bool = False) -> Json:
    return _cell(score.estimate(estimate, signed), estimate.mean, estimate.low, estimate.high)


def _cell(text: str, value: float, low: float = math.nan, high: float = math.nan) -> Json:
    ends = {} if math.isnan(low) else {"low": to_json(low), "high": to_json(high)}
    return {"text": text, "value": to_json(value), **ends}


def _by_target(results: Results, label: str, condition: str) -> Json:
    """By score, the value of every target in their order; null for a hole."""
    return {
        score.key: [to_json(value) for value in results.values(label, condition, score.key)]
        for score in results.leading
    }
