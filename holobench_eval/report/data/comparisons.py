"""tests.csv: a row for every paired test of a report, and its columns."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd

from . import columns
from .column import Column, column
from .results import Results
from .scores import Score
from .statistics import PairedTest

TESTS: list[Column] = []
_KEYS = ("study", "measure", "display", "condition", "method", "label")  # as in table.csv, of the tested row
_MEANINGS = {"method": "Name of the tested method in configs", "label": "Name of its row in tables"}


@column(TESTS)
def baseline(test: PairedTest, results: Results) -> str:
    """Label of the row that it is compared with."""
    return test.first


@column(TESTS)
def metric(test: PairedTest, results: Results) -> str:
    """The score that is compared: a column of records.csv."""
    return results.headline.column


@column(TESTS, "count")
def n(test: PairedTest, results: Results) -> int:
    """Targets with a score of both."""
    return test.estimate.n


@column(TESTS, "count")
def clusters(test: PairedTest, results: Results) -> int:
    """Their clusters."""
    return test.estimate.clusters


@column(TESTS, "count")
def better(test: PairedTest, results: Results) -> int:
    """Targets with a better score than the baseline's."""
    return sum(results.headline.better(float(value), 0.0) for value in test.known)


@column(TESTS, "number")
def difference(test: PairedTest, results: Results) -> float:
    """Score minus that of the baseline, mean over targets."""
    return test.estimate.mean


@column(TESTS, "number")
def difference_lo(test: PairedTest, results: Results) -> float:
    """Lower end of its 95 % interval over clusters of targets, of one comparison and not adjusted."""
    return test.estimate.low


@column(TESTS, "number")
def difference_hi(test: PairedTest, results: Results) -> float:
    """Upper end of that interval."""
    return test.estimate.high


@column(TESTS, "number")
def difference_median(test: PairedTest, results: Results) -> float:
    """Median of the differences over targets."""
    return float(np.median(test.known)) if test.known.size else np.nan


@column(TESTS, "number")
def p_adjusted(test: PairedTest, results: Results) -> float:
    """Two-sided p of the mean difference, sign-flip max-t over clusters, adjusted for all tests of the study; empty:
    not tested."""
    return test.p


def of_tests(headline: Score) -> list[Column]:
    """The columns of tests.csv, in their order, for a headline, whose unit ends the names of differences."""
    table = {column.name: column for column in columns.tabled()}
    keys = [replace(table[name], meaning=_MEANINGS.get(name, table[name].meaning)) for name in _KEYS]
    return keys + [
        replace(column, name=f"{column.name}{headline.suffix}", unit=headline.unit)
        if column.name.startswith("difference")
        else column
        for column in TESTS
    ]


def comparison_frame(results: Results) -> pd.DataFrame:
    """The frame of tests.csv, without a row where there is no baseline."""
    tests = results.against_baseline if results.layout.baseline else ()
    rows = [results.row(test.second, test.condition) for test in tests]
    found = {name: [row[name] for row in rows] for name in _KEYS}
    sources = {column.name: column.source for column in of_tests(results.headline) if column.name not in _KEYS}
    found |= {name: [source(test, results) for test in tests] for name, source in sources.items() if source}
    return pd.DataFrame(found)
