"""The paired tests against the baseline, and the cells without a score."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..markdown import Markdown, heading, table_of
from ..results import Results
from ..section import Blocks, Figures, Report, Section
from ..statistics import FEWEST, POWER, SIGNIFICANCE, PairedTest
from ..text import sample


def _paired_tests(report: Report, _: Figures) -> Blocks:
    results = report.results
    tests = list(results.tests.values())
    yield heading("Paired tests")
    if not tests:
        yield "There are no comparisons with a baseline."
        return
    yield (
        f"Differences to the baseline {report.results.baseline}, target by target, repeats averaged first: "
        f"{results.headline.axis}{report.results.text.axis}. Two-sided sign-flip min-p test (step-down) over "
        f"clusters of targets; each p is adjusted for all {sum(np.isfinite(test.p) for test in tests)} tests of this "
        "table, in which the oracle has none; intervals are not adjusted. At "
        f"p >= {SIGNIFICANCE} a difference is not shown, which does not mean that there is none. "
        f'"Could show": what a test of this comparison alone shows with {100 * POWER:.0f} % power. '
        f"Pairs with a hole are omitted and counted. Fewer than {FEWEST} clusters give no test and no interval."
    )
    yield _tests(results, tests)


def _tests(results: Results, tests: Sequence[PairedTest]) -> Markdown | None:
    score, name = results.headline, results.facts.marked
    return table_of(
        [
            {
                "comparison": f"{name(test.second)} – {name(test.first)}",
                "display": test.condition,
                "complete pairs": sample(test.estimate, len(results.targets)),
                f"mean difference{score.brackets}": score.estimate(test.estimate, signed=True),
                f"median{score.brackets}": score.number(test.median, signed=True),
                "better on": f"{test.better(score.sign)} of {test.estimate.n}",
                f"could show{score.brackets}": score.number(np.nan if np.isnan(test.p) else test.estimate.detectable),
                "p": "no test" if np.isnan(test.p) else f"{test.p:.4f}",
                "difference": "–" if np.isnan(test.p) else "shown" if test.is_shown else "not shown",
            }
            for test in tests
        ]
    )


def _holes(report: Report, _: Figures) -> Blocks:
    """Every cell without a score, with its reason."""
    holes = report.results.holes[["label", "condition", "target", "repeat", "state", "reason"]]
    rows = holes.rename(columns={"label": "method", "condition": "display"}).to_dict("records")
    yield heading("Holes")
    if rows:
        yield (
            "Cells without a score. They enter no mean, and a method without a score for every target is not ranked."
        )
    yield (
        table_of(
            [row | {"repeat": f"{row['repeat']:.0f}", "reason": row["reason"] or "no reason given"} for row in rows]
        )
        or "None: every planned cell has a score."
    )


SECTIONS = (Section("paired tests", 120, _paired_tests, details=True), Section("holes", 190, _holes, details=True))
