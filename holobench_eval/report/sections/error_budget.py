"""The chart of where the error of captures comes from."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from ..charts.error_budget import draw_budgets
from ..data.error_budget import budgets
from ..section import Report, Section


def _figures(report: Report) -> Iterator[tuple[Path, str]]:
    found = budgets(report.results)
    if found:
        path = report.figures / "error-budget.png"
        draw_budgets(path, found)
        yield (
            path,
            "The error budget. Left: parts of the squared error of the captures, by display, with their PSNR. Right: "
            "what removing a part and all parts to its left would gain at most, with its 95 % interval over clusters; "
            "for temporal noise, what captures with no other error would gain.",
        )


def _applies(report: Report) -> bool:
    return report.layout.measure == "error_budget" and bool(report.results.conditions)


SECTIONS = (Section("error budget", 5, applies=_applies, figures=_figures),)
