"""Target by target: paired tests, every value of the headline metric, and the holes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..data.results import Results
from ..data.statistics import PairedTest
from ..markdown import Markdown, heading, table
from ..section import Blocks, Figures, Report, Section


def _paired_tests(report: Report, _: Figures) -> Blocks:
    results = report.results
    yield heading("Paired tests")
    yield (
        f"Paired differences over targets, repeats averaged first: {results.headline.axis}{report.layout.text.axis}. "
        "Exact two-sided Wilcoxon signed-rank test; Holm's correction over all comparisons of one display in one "
        "table. Pairs with a hole are omitted and counted. Fewer than three complete pairs give no test and no "
        "interval."
    )
    if results.against_baseline:
        yield heading(f"Against the baseline {report.layout.baseline}", 3)
        yield _tests(results, results.against_baseline)
    else:
        yield "There are no comparisons with a baseline."
    if results.between_all:
        yield heading("Between all methods", 3)
        yield _tests(results, results.between_all)


def _tests(results: Results, tests: Sequence[PairedTest]) -> Markdown:
    score, name = results.headline, results.layout.marked
    rows = [
        [
            f"{name(test.second)} – {name(test.first)}",
            test.condition,
            f"{test.complete} of {test.targets}",
            score.estimate(test.difference, signed=True),
            *("no test" if np.isnan(p) else f"{p:.4f}" for p in (test.p, test.p_holm)),
        ]
        for test in tests
    ]
    difference = f"mean difference, {score.axis}"
    return table(["comparison", "display", "complete pairs", difference, "p", "p (Holm)"], rows)


def _every_target(report: Report, _: Figures) -> Blocks:
    yield heading("Every target")
    yield f"{report.results.headline.axis}{report.layout.text.axis}, repeats averaged."
    yield report.by_display(_by_target)


def _by_target(results: Results, condition: str) -> Markdown:
    names = results.methods(condition)
    columns = [results.values(name, condition) for name in names]
    rows = [
        [target, *(results.headline.number(column[index]) for column in columns)]
        for index, target in enumerate(results.targets)
    ]
    return table(["target", *map(results.layout.marked, names)], rows)


def _holes(report: Report, _: Figures) -> Blocks:
    """Every cell without a score, with its reason."""
    columns = ["method", "condition", "target", "repeat", "state", "reason"]
    rows = [
        [method, condition, target, f"{repeat:.0f}", state, reason or "no reason given"]
        for method, condition, target, repeat, state, reason in report.results.holes[columns].itertuples(index=False)
    ]
    yield heading("Holes")
    if rows:
        yield (
            "Cells without a score. They enter no mean, and a method without a score for every target is not ranked."
        )
        yield table(["method", "display", "target", "repeat", "state", "reason"], rows)
    else:
        yield "None: every planned cell has a score."


SECTIONS = (
    Section("paired tests", 120, _paired_tests),
    Section("every target", 180, _every_target),
    Section("holes", 190, _holes),
)
