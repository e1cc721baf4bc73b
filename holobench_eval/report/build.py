"""report.md, report.html, table.csv, records.csv and the figures of a study, from its records."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ..core.io import write_atomically
from ..study.definition import Study
from .data.layout import Layout, layout_of
from .data.results import Results
from .data.tables import csv_text, read_records, records_frame
from .description import Description, describe
from .markdown import Markdown, blocks
from .page import write_page
from .section import Report
from .sections import sections

# Figures that a report draws itself; others in its folder, such as the stages of a bench, are drawn elsewhere.
DRAWN = ("comparison-*.jpg", "sweep-*.jpg", "quality-*.png", "training-*.png")


def build_report(
    study: Study, records: Sequence[Mapping[str, Any]], output: Path, provenance: Mapping[str, Any]
) -> tuple[Path, Results]:
    """Write everything a reader of the study gets into ``output``; return the path of report.md and its numbers.

    records: one for every planned cell, as ``Store.load`` gives them; thumbnails are taken from ``output/records``.
    provenance: see ``study.provenance``. UserError when no record has the headline metric.
    """
    return write_report(layout_of(study), records, output, provenance, describe(study))


def write_report(
    layout: Layout,
    records: Sequence[Mapping[str, Any]],
    output: Path,
    provenance: Mapping[str, Any],
    description: Description,
) -> tuple[Path, Results]:
    """``build_report`` for a study that is given by its layout and description."""
    results = Results(records_frame(records, layout), layout)
    report = Report(results, records, output, provenance, description)
    write_atomically(output / "records.csv", csv_text(results.frame).encode())
    write_atomically(output / "table.csv", csv_text(results.table).encode())
    for pattern in DRAWN:
        for old in report.figures.glob(pattern):
            old.unlink()
    write_atomically(output / "report.md", f"{_text(report)}\n".encode())
    write_page(report)
    return output / "report.md", results


def _text(report: Report) -> Markdown:
    numbers, parts = itertools.count(1), list[object]()
    for section in sections():
        if section.applies(report):
            drawn = [_figure(next(numbers), path, caption) for path, caption in section.figures(report)]
            parts += section.render(report, drawn)
    return blocks(parts)


def _figure(number: int, path: Path, caption: str) -> Markdown:
    image = Markdown("![Figure {}]({}/{})").format(number, path.parent.name, path.name)
    return blocks([image, Markdown("**Figure {}.** {}").format(number, caption)])


def recompute_table(records_csv: str, layout: Layout) -> str:
    """The text of table.csv computed anew from the text of records.csv; equal bytes mean that they belong together."""
    return csv_text(Results(read_records(records_csv), layout).table)
