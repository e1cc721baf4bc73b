"""tests.csv: a row for every paired test of a report, and its columns."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pandas as pd

from ..data.column import Column
from ..data.columns import tabled
from ..data.results import Results
from ..data.scores import Score
from ..data.statistics import POWER, PairedTest

_KEYS = ("study", "measure", "display", "condition", "method", "label")  # as in table.csv, of the tested row
_MEANINGS = {"method": "Name of the tested method in configs", "label": "Name of its row in tables"}
_P = (
    "Two-sided p of the mean difference, sign-flip min-p over clusters, adjusted for all tests of the study; empty: "
    "not tested"
)
_LOW = "Lower end of its 95 % interval over clusters of targets, of one comparison and not adjusted"
_DETECTABLE = f"Size of a mean difference that a test of this one alone shows with {100 * POWER:.0f} % power"


def of_tests(headline: Score) -> list[Column]:
    """The columns of tests.csv, in their order, for a headline, whose unit ends the names of differences; the source of
    those that are not in table.csv is given a test."""

    def difference(end: str, meaning: str, value: Callable[[PairedTest], float]) -> Column:
        return Column(f"difference{end}{headline.suffix}", meaning, "number", headline.unit, value)

    table = {column.name: column for column in tabled()}
    return [
        *(replace(table[name], meaning=_MEANINGS.get(name, table[name].meaning), source=None) for name in _KEYS),
        Column("baseline", "Label of the row that it is compared with", source=lambda test: test.first),
        Column("metric", "The score that is compared: a column of records.csv", source=lambda test: headline.column),
        Column("n", "Targets with a score of both", "count", source=lambda test: test.estimate.n),
        Column("clusters", "Their clusters", "count", source=lambda test: test.estimate.clusters),
        Column(
            "better",
            "Targets with a better score than the baseline's",
            "count",
            source=lambda test: test.better(headline.sign),
        ),
        difference("", "Score minus that of the baseline, mean over targets", lambda test: test.estimate.mean),
        difference("_lo", _LOW, lambda test: test.estimate.low),
        difference("_hi", "Upper end of that interval", lambda test: test.estimate.high),
        difference("_median", "Median of the differences over targets", lambda test: test.median),
        difference("_detectable", _DETECTABLE, lambda test: test.estimate.detectable),
        Column("p_adjusted", _P, "number", source=lambda test: test.p),
    ]


def comparison_frame(results: Results) -> pd.DataFrame:
    """The frame of tests.csv, without a row where there is no baseline."""
    tests = results.against_baseline
    rows = [results.row(test.second, test.condition) for test in tests]
    return pd.DataFrame(
        {
            column.name: [column.source(test) for test in tests]
            if column.source
            else [row[column.name] for row in rows]
            for column in of_tests(results.headline)
        }
    )
