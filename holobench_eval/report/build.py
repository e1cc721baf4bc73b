"""report.md, details.md, report.html, the figures and the files of data of a study, from its records."""

from __future__ import annotations

import itertools
import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from ..core.errors import UserError
from ..core.io import write_atomically
from ..study.definition import Study
from ..study.plan import plan
from .board import texts
from .charts.look import MEDIA, drawn_for
from .charts.tiles import draw_wall
from .description import Description, describe
from .facts import Facts, facts_of
from .markdown import DETAILS, REPORT, Markdown, blocks
from .page import keep_copies, write_page
from .results import Results, difference, of_study, read_records, records_frame, records_text
from .stories import parts
from .stories.overview import chosen
from .story import Report

# Figures that a report draws itself, those of pictures from thumbnails; the stages of a bench are drawn during the run.
OF_PICTURES = ("answer-*.jpg", "comparison-*.jpg", "sweep-*.jpg")
OF_NUMBERS = ("quality-*.png", "training-*.png")
STAGES = "stages-*.png"
SLIDE_TARGETS, SLIDE_METHODS = 3, 6


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
    return write_report(facts_of(study), records, output, provenance, describe(study), keep_pictures)


def write_report(
    facts: Facts,
    records: Sequence[Mapping[str, Any]],
    output: Path,
    provenance: Mapping[str, Any],
    description: Description,
    keep_pictures: bool = False,
) -> tuple[Path, Results]:
    """``build_report`` for a study that is given by its facts and description."""
    results = Results(records_frame(records, facts), facts, related(facts, output))
    report = Report(results, records, output, provenance, description, keep_pictures)
    for name, text in texts(results).items():
        write_atomically(output / name, text.encode())
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
    numbers, content = itertools.count(1), dict[str, list[object]]({REPORT: [], DETAILS: []})
    for part in parts():
        if part.applies(report):
            drawn = [_figure(next(numbers), path, caption) for path, caption in part.figures(report)]
            content[DETAILS if part.details else REPORT] += part.render(report, drawn)
    return {name: blocks(text) for name, text in content.items()}


def _figure(number: int, path: Path, caption: str) -> Markdown:
    image = Markdown("![Figure {}]({}/{})").format(number, path.parent.name, path.name)
    return blocks([image, Markdown("**Figure {}.** {}").format(number, caption)])


def related(facts: Facts, folder: Path) -> dict[str, Results]:
    """Results of the parts that predict, where the folder of their study has a report of theirs as they are now."""
    known = dict[str, Results]()
    for name, own in facts.related.items():
        with suppress(UserError, OSError):  # there is none, or it is damaged, as its own check says
            frame = read_records(records_text(folder / name / "records.csv"))
            if not difference(frame, plan(own.study)):
                known[name] = Results(of_study(frame, own), own)
    return known


def recompute_files(records_csv: str, facts: Facts) -> dict[str, str]:
    """The text of every file of data, by name, computed anew from that of records.csv; equal bytes belong together."""
    return texts(Results(of_study(read_records(records_csv), facts), facts))


def print_figures(report: Report, folder: Path, medium: str) -> Iterator[Path]:
    """Draw the charts of a report for one of ``MEDIA`` into a folder, and for a talk captures; every file."""
    with TemporaryDirectory() as drawn, drawn_for(MEDIA[medium]):
        printed = replace(report, keeps_pictures=True, drawn=Path(drawn))
        for part in parts():
            if part.applies(printed):
                list(part.figures(printed))
        if MEDIA[medium].height:
            _draw_slide(printed)
        for path in sorted(Path(drawn).iterdir()):
            folder.mkdir(parents=True, exist_ok=True)
            yield Path(shutil.copy(path, folder))


def _draw_slide(report: Report) -> None:
    """The question, and captures of the targets whose differences are nearest to the mean, on the first display that
    has any of all methods of the row of pictures."""
    results, thumbnails = report.results, report.thumbnails
    for condition in filter(results.has_pictures, results.conditions):
        labels = sorted(chosen(results, condition), key=lambda label: label != results.baseline)[:SLIDE_METHODS]
        targets, pictures = thumbnails.typical(labels, condition)[:SLIDE_TARGETS], thumbnails.targets(condition)
        if targets:
            below = f"{condition}: {results.headline.axis}{results.text.axis}"
            rows = {
                target: (pictures[target], [(label, thumbnails.tile(label, condition, target, 1)) for label in labels])
                for target in targets
            }
            draw_wall(report.figures / "slide.png", results.study.question or results.study.title, below, rows)
            return
