"""Figures for print: every chart of numbers as PDF and SVG, one and two columns wide."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from .charts.look.medium import COLUMNS, drawn_for
from .section import Report
from .sections import sections


@dataclass(frozen=True)
class _Printed(Report):
    """A report whose figures go elsewhere."""

    folder: Path = field(kw_only=True)

    @property
    def figures(self) -> Path:
        return self.folder


def print_figures(report: Report, folder: Path) -> Iterator[Path]:
    """Draw the charts of a report into ``folder/single`` (84 mm wide) and ``folder/double`` (174 mm); every file."""
    for name, medium in COLUMNS.items():
        parts = report.results, report.records, report.output, report.provenance, report.description
        printed = _Printed(*parts, kept={}, folder=folder / name)  # none of the figures made of pictures
        with drawn_for(medium):
            for section in sections():
                if section.applies(printed):
                    for path, _ in section.figures(printed):
                        yield from (path.with_suffix(suffix) for suffix in medium.suffixes)
