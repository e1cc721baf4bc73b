"""A comparison of two runs as tables: in Markdown, on a console, and in compare.csv."""

from __future__ import annotations

import itertools
from collections import Counter
from dataclasses import dataclass

import numpy as np
import pandas as pd

from ..markdown import Markdown, blocks, heading, table_of
from ..results import csv_text
from ..scores import Score
from ..text import words
from .paired import EQUAL, Comparison, Row, provenance_differences

TARGETS = 10  # that changed most, in the list


@dataclass(frozen=True)
class Part:
    """A table of a comparison: its title, a sentence, and rows of plain text by their headings, which may be none."""

    title: str
    sentence: str
    rows: list[dict[str, str]]


def parts(comparison: Comparison) -> list[Part]:
    """The tables of a comparison, the differences first."""
    return [table(comparison) for table in (_differences, _targets, _unpaired, _provenance)]


def markdown(comparison: Comparison) -> str:
    """The text of compare.md."""
    title = heading(Markdown("{} and {}").format(comparison.a.folder.name, comparison.b.folder.name), level=1)
    tables = ((heading(part.title), part.sentence, table_of(part.rows)) for part in parts(comparison))
    return f"{blocks(itertools.chain([title], *tables))}\n"


def csv(comparison: Comparison) -> str:
    """The text of compare.csv: a row per method and display, in the order of the tables."""
    score = comparison.score
    rows = [
        {
            "method": row.method,
            "display_a": row.displays[0],
            "display_b": row.displays[1],
            "score": score.key,
            "unit": score.unit,
            "targets": row.change.n,
            "clusters": row.change.clusters,
            "mean_a": row.a.mean(),
            "mean_b": row.b.mean(),
            "difference": row.change.mean,
            "difference_low": row.change.low,
            "difference_high": row.change.high,
            "p_adjusted": row.p,
            "verdict": row.verdict,
        }
        for row in comparison.rows
    ]
    return csv_text(pd.DataFrame(rows))


def _differences(comparison: Comparison) -> Part:
    score, rows = comparison.score, comparison.rows
    found = words([f"{count} {verdict}" for verdict, count in Counter(row.verdict for row in rows).items()])
    changed = [row for row in rows if row.verdict != EQUAL]
    unlisted = ", in which no target has changed and which are not listed" if len(changed) < len(rows) else ""
    same = "all" if comparison.unchanged == comparison.cells else f"{comparison.unchanged}"
    sentence = (
        f"A is {comparison.a.folder}, B is {comparison.b.folder}. Differences of {score.heading} are B - A over the "
        f"targets with a score in both, with 95 % intervals over clusters of targets. Rows: {found}{unlisted}. Worse "
        "and better mean that the interval is clear of zero, and not shown that it is not; intervals are not adjusted "
        f"for the number of rows, the p values in compare.csv are. Of {comparison.cells} paired cells, {same} have one "
        "identity in both runs: the same settings, target, display and declared versions of the code."
    )
    protocols = [words(sorted(set(map(str, run.records.get("protocol", ()))))) for run in (comparison.a, comparison.b)]
    if protocols[0] != protocols[1]:
        sentence += f" A is scored by metric protocol {protocols[0]} and B by {protocols[1]}."
    return Part("Differences", sentence, [_difference(row, score) for row in changed])


def _difference(row: Row, score: Score) -> dict[str, str]:
    change = row.change
    interval = "" if np.isnan(change.low) else f" [{_change(score, change.low)}, {_change(score, change.high)}]"
    return {
        "method": row.method,
        "display": row.display,
        "targets": str(change.n),
        "A": score.number(float(row.a.mean())),
        "B": score.number(float(row.b.mean())),
        "B - A": f"{_change(score, change.mean)}{interval}",
        "verdict": row.verdict,
    }


def _change(score: Score, value: float) -> str:
    """A difference with its sign: runs may differ by less than the digits of a score show."""
    digits = len(score.number(0.0).partition(".")[2]) + 1
    return f"{value:+z.{digits}f}"


def _targets(comparison: Comparison) -> Part:
    score, most = comparison.score, comparison.moved(TARGETS)
    rows = [
        {"target": target, "method": row.method, "display": row.display}
        | {"A": score.number(a), "B": score.number(b), "B - A": _change(score, b - a)}
        for row, target, a, b in most
    ]
    sentence = f"The {len(most)} largest changes of a target." if most else "No target has changed."
    return Part("Targets that changed most", sentence, rows)


def _unpaired(comparison: Comparison) -> Part:
    rows = [
        {"run": u.run, "method": u.method, "display": u.display, "cells": str(u.cells), "in the other run": u.why}
        for u in comparison.unpaired
    ]
    sentence = "Cells with a score in one run alone. They are in no mean above." if rows else "Nothing."
    return Part("Only in one run", sentence, rows)


def _provenance(comparison: Comparison) -> Part:
    a, b = comparison.a, comparison.b
    lacking = [name for name, run in (("A", a), ("B", b)) if not run.provenance]
    rows = [{"fact": name, "A": first, "B": second} for name, first, second in provenance_differences(a, b)]
    sentence = "What the two runs were computed with, where it differs." if rows else "No recorded fact differs."
    if lacking:
        sentence = f"{words(lacking)} {'has' if len(lacking) == 1 else 'have'} no provenance.json. {sentence}"
    return Part("Provenance", sentence, rows)
