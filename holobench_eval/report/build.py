"""report.md, table.csv, records.csv and the figures of a study, from its records."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from markupsafe import Markup

from ..core.io import write_atomically
from .charts.figures import Figures, draw_figures
from .data.layout import Layout, layout_of
from .data.ranks import ranks
from .data.results import Results
from .data.statistics import RESAMPLES
from .data.sweeps import sweeps
from .data.tables import MEMORY_COLUMN, csv_text, read_records, records_frame
from .data.text import FILES
from .markdown import render
from .sections import alignment as section_alignment
from .sections import diagnosis as section_diagnosis
from .sections import focus as section_focus
from .sections import leaderboard
from .sections import ranks as section_ranks
from .sections import sweeps as section_sweeps
from .sections import tables as sections
from .sections import training as section_training
from .sections.description import Description, counts, describe, environment, method_parameters, rules, setup
from .sections.findings import blur_keys, findings
from .sections.training import Trained

if TYPE_CHECKING:
    from ..study.definition import Study

TEMPLATE = "report.md.j2"


def build_report(
    study: Study, records: Sequence[Mapping[str, Any]], output: Path, provenance: Mapping[str, Any]
) -> tuple[Path, Results]:
    """Write everything a reader of the study gets into ``output``; return the path of report.md and its numbers.

    records: one for every planned cell, as ``Store.load`` gives them; thumbnails are taken from ``output/records``.
    provenance: see ``study.provenance``. UserError when no record has the headline metric.
    """
    results = results_of(study, records)
    return write_results(results, records, output, provenance, describe(study)), results


def write_report(
    layout: Layout,
    records: Sequence[Mapping[str, Any]],
    output: Path,
    provenance: Mapping[str, Any],
    description: Description,
) -> Path:
    """``build_report`` for a study that is given by its layout and description; the path of report.md."""
    return write_results(Results(records_frame(records, layout), layout), records, output, provenance, description)


def write_results(
    results: Results,
    records: Sequence[Mapping[str, Any]],
    output: Path,
    provenance: Mapping[str, Any],
    description: Description,
) -> Path:
    """``write_report`` where the numbers of the records are there already."""
    layout = results.layout
    write_atomically(output / "records.csv", csv_text(results.frame).encode())
    write_atomically(output / "table.csv", csv_text(results.table).encode())
    trained = section_training.trainings(layout, records, output)
    context = (
        _numbers(results)
        | _changes(results)
        | _draws(results)
        | _words(results, records, provenance, description)
        | _training(layout, trained)
    )
    figures = draw_figures(results, trained, output)
    text = render(TEMPLATE, context | _pictures(figures))
    write_atomically(output / "report.md", text.encode())
    return output / "report.md"


def results_of(study: Study, records: Sequence[Mapping[str, Any]]) -> Results:
    """The numbers of a study, for those who want to ask them without writing a report."""
    layout = layout_of(study)
    return Results(records_frame(records, layout), layout)


def recompute_table(records_csv: str, layout: Layout) -> str:
    """The text of table.csv computed anew from the text of records.csv; equal bytes mean that they belong together."""
    return csv_text(Results(read_records(records_csv), layout).table)


def _numbers(results: Results) -> dict[str, Any]:
    """Everything in the template that is computed from the records."""

    def each(section: Callable[[Results, str], Markup]) -> list[tuple[str, Markup]]:
        shown = [(condition, section(results, condition)) for condition in results.conditions]
        return [(condition, text) for condition, text in shown if text]

    metrics, wanted = {score.metric for score in results.scores}, results.layout.metrics
    return {
        "counts": counts(results),
        "findings": findings(results),
        "headline": results.headline,
        "headline_tables": each(sections.headline),
        "stopped": {condition: leaderboard.stopped(results, condition) for condition in results.conditions},
        "leaderboards": each(leaderboard.leaderboard),
        "tracks": leaderboard.tracks(results),
        "leaderboard_reading": leaderboard.reading(results),
        "privileged": bool(results.layout.privileged),
        "lpips_missing": not any(metric.startswith("lpips") for metric in metrics)
        and (wanted is None or any(metric.startswith("lpips") for metric in wanted)),
        "mofd": "mofd" in metrics,
        "floors": sections.floors(results) if results.floors else "",
        "baseline": results.layout.baseline,
        "baseline_tests": sections.tests(results, results.against_baseline) if results.against_baseline else "",
        "all_tests": sections.tests(results, results.between_all) if results.between_all else "",
        "planes": [
            (condition, shown, section_focus.sentences(results, condition))
            for condition, shown in each(section_focus.by_plane)
        ],
        "domain_tables": each(sections.domains),
        "geometry_tables": each(sections.geometry),
        "blur_tables": each(sections.blur),
        "blurred": next(iter(blur_keys(results)), results.headline),
        "memory": MEMORY_COLUMN in results.table,
        "light_tables": each(sections.light_and_time),
        "target_tables": each(sections.per_target),
        "holes": sections.holes(results),
        "resamples": f"{RESAMPLES:,}",
    }


def _changes(results: Results) -> dict[str, Any]:
    """The section on changes of the displays, empty for a study without them."""
    every = sweeps(results)
    told = [
        (
            section_sweeps.heading(sweep),
            section_sweeps.introduction(sweep),
            section_sweeps.scores(sweep),
            section_sweeps.losses(sweep),
            section_sweeps.sentences(sweep, every),
        )
        for sweep in every
        if sweep.methods
    ]
    return {
        "sweeps": told,
        "claims": section_sweeps.claims(results, every),
    }


def _draws(results: Results) -> dict[str, Any]:
    """The section on rankings over draws of the displays, empty for a study without them."""
    told = [
        (
            section_ranks.heading(one),
            section_ranks.sentences(one),
            section_ranks.methods(one) if one.told else "",
            section_ranks.flips(one) if one.told else "",
            section_ranks.ranges(one),
        )
        for one in ranks(results)
    ]
    return {"ranks": told, "ranks_introduction": section_ranks.introduction()}


def _words(
    results: Results,
    records: Sequence[Mapping[str, Any]],
    provenance: Mapping[str, Any],
    description: Description,
) -> dict[str, Any]:
    """Everything in the template that describes the study."""
    layout = results.layout
    return rules(results) | {
        "title": layout.title,
        "note": layout.note,
        "said": layout.wording,
        "on_a_network": layout.learned_display is not None,
        "efficiency": "efficiency" in results.frame,
        "setup": setup(results, records),
        "profiles": description.displays,
        "parameters": sections.parameters(method_parameters(results, records)),
        "timing": sections.timing(results, provenance.get("workers", 1)),
        "reported_source": layout.reported_source,
        "seed": layout.seed,
        "command": description.command or f"holoeval run {description.config_file or 'CONFIG.yaml'}",
        "from_files": layout.measure == FILES,
        "alignments": section_alignment.table_of(results, records) if layout.measure == FILES else "",
        "alignment_sentences": section_alignment.sentences(results, records) if layout.measure == FILES else [],
        "config_name": description.config_file,
        "config_text": description.config_text,
        "environment": environment(provenance),
    }


def _training(layout: Layout, trained: Sequence[Trained]) -> dict[str, Any]:
    """The section on training, empty for a study in which nothing is trained."""
    return {
        "trained": bool(trained),
        "training_paragraph": section_training.paragraph(layout, trained),
        "training_table": section_training.summary(layout, trained),
        "training_rounds": section_training.rounds(trained),
        "training_doubts": section_training.doubts(trained),
        "diagnoses": section_diagnosis.diagnoses(trained),
        "missing": section_diagnosis.missing(trained),
    }


def _pictures(figures: Figures) -> dict[str, Any]:
    return {
        "charts": figures.charts,
        "frontiers": figures.frontiers,
        "sweep_figures": figures.sweeps,
        "rank_figures": figures.ranks,
        "comparisons": figures.comparisons,
        "stages": figures.stages,
        "alignment_figures": figures.alignments,
        "training_figures": figures.trainings,
        "absent": figures.absent,
    }
