"""report.md, details.md, report.html, the figures and the files of data of a study, from its records."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from ..core.io import write_atomically
from ..study.definition import Study
from .charts.look.medium import MEDIA, drawn_for
from .data.layout import Layout, layout_of
from .data.results import Results
from .data.tables import of_study, read_records, records_frame, records_text
from .description import Description, describe
from .files import texts, write_files
from .markdown import DETAILS, REPORT, Markdown, blocks
from .page import write_page
from .page.pictures import keep_copies
from .section import Report
from .sections import sections

# Figures that a report draws itself, those of pictures from thumbnails; the stages of a bench are drawn during the run.
OF_PICTURES = ("answer-*.jpg", "comparison-*.jpg", "sweep-*.jpg")
OF_NUMBERS = ("quality-*.png", "training-*.png")
STAGES = "stages-*.png"


def build_report(
    study: Study,
    records: Sequence[Mapping[str, Any]],
    output: Path,
    provenance: Mapping[str, Any],
    keep_pictures: bool = False,
) -> tuple[Path, Results]:
    """Write everything a reader of the study gets into ``output``; return the path of report.md and its numbers.

    records: one for every planned cell, as ``Store.load`` gives them; thumbnails are taken from ``output/records``.
    provenance: see ``study.running.provenance``; keep_pictures: keep the figures made of pictures that are there, with
    their captions, and draw the others alone. UserError when no record has the headline metric.
    """
    return write_report(layout_of(study), records, output, provenance, describe(study), keep_pictures)


def write_report(
    layout: Layout,
    records: Sequence[Mapping[str, Any]],
    output: Path,
    provenance: Mapping[str, Any],
    description: Description,
    keep_pictures: bool = False,
) -> tuple[Path, Results]:
    """``build_report`` for a study that is given by its layout and description."""
    results = Results(records_frame(records, layout), layout, related(layout, output))
    report = Report(results, records, output, provenance, description, keep_pictures)
    write_files(results, output)
    for pattern in OF_NUMBERS if keep_pictures else (*OF_PICTURES, *OF_NUMBERS):
        for old in report.figures.glob(pattern):
            old.unlink()
    written = _texts(report)
    for name, text in written.items():
        write_atomically(output / name, f"{text}\n".encode())
    for old in report.figures.glob(STAGES):  # of displays that the study had earlier
        if not any(old.name in text for text in written.values()):
            old.unlink()
    keep_copies(report)
    write_page(report)
    return output / REPORT, results


def _texts(report: Report) -> dict[str, Markdown]:
    """The text of each file, by its name."""
    numbers, parts = itertools.count(1), dict[str, list[object]]({REPORT: [], DETAILS: []})
    for section in sections():
        if section.applies(report):
            drawn = [_figure(next(numbers), path, caption) for path, caption in section.figures(report)]
            parts[DETAILS if section.details else REPORT] += section.render(report, drawn)
    return {name: blocks(text) for name, text in parts.items()}


def _figure(number: int, path: Path, caption: str) -> Markdown:
    image = Markdown("![Figure {}]({}/{})").format(number, path.parent.name, path.name)
    return blocks([image, Markdown("**Figure {}.** {}").format(number, caption)])


def related(layout: Layout, folder: Path) -> dict[str, Results]:
    """Results of the parts that predict, where they have a report in the folder of their study."""
    known = {name: folder / name / "records.csv" for name in layout.related}
    return {
        name: Results(of_study(read_records(records_text(path)), layout.related[name]), layout.related[name])
        for name, path in known.items()
        if path.is_file()
    }


def recompute_files(records_csv: str, layout: Layout) -> dict[str, str]:
    """The text of every file of data, by name, computed anew from that of records.csv; equal bytes belong together."""
    return texts(Results(of_study(read_records(records_csv), layout), layout))


def print_figures(report: Report, folder: Path, medium: str) -> Iterator[Path]:
    """Draw the charts of a report for one of ``MEDIA`` into a folder, none of those made of pictures; every file."""
    printed = replace(report, keeps_pictures=True, drawn=folder)
    with drawn_for(MEDIA[medium]):
        for section in sections():
            if section.applies(printed):
                for path, _ in section.figures(printed):
                    yield from (path.with_suffix(suffix) for suffix in MEDIA[medium].suffixes)
