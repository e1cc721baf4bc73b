"""Figures for print: every chart of numbers as PDF and SVG, one and two columns wide."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from .charts.look.medium import COLUMNS, drawn_for
from .charts.thumbnails import Thumbnails
from .section import Report
from .sections import sections


@dataclass(frozen=True)
class _Printed(Report):
    """A report whose figures go elsewhere, without pictures: there are thumbnails neither there nor in ``folder``."""

    folder: Path

    @property
    def figures(self) -> Path:
        return self.folder

    @cached_property
    def thumbnails(self) -> Thumbnails:
        return Thumbnails(self.results, self.folder)


def print_figures(report: Report, folder: Path) -> Iterator[Path]:
    """Draw the charts of a report into ``folder/single`` (84 mm wide) and ``folder/double`` (174 mm); every file."""
    for name, medium in COLUMNS.items():
        printed = _Printed(
            report.results, report.records, report.output, report.provenance, report.description, folder / name
        )
        with drawn_for(medium):
            for section in sections():
                if section.applies(printed):
                    for path, _ in section.figures(printed):
                        yield from (path.with_suffix(suffix) for suffix in medium.suffixes)
