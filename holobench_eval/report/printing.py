"""Figures for slides and print: every chart of numbers as wide as its medium."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from .charts.look.medium import MEDIA, drawn_for
from .section import Report
from .sections import sections


@dataclass(frozen=True)
class _Printed(Report):
    """A report whose figures go elsewhere."""

    folder: Path = field(kw_only=True)

    @property
    def figures(self) -> Path:
        return self.folder


def print_figures(report: Report, folder: Path, medium: str) -> Iterator[Path]:
    """Draw the charts of a report for one of ``MEDIA`` into a folder; every file."""
    parts = report.results, report.records, report.output, report.provenance, report.description
    printed = _Printed(*parts, kept={}, folder=folder)  # none of the figures made of pictures
    with drawn_for(MEDIA[medium]):
        for section in sections():
            if section.applies(printed):
                for path, _ in section.figures(printed):
                    yield from (path.with_suffix(suffix) for suffix in MEDIA[medium].suffixes)
