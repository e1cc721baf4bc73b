"""``holoeval figure``: the charts of a report for a talk or a paper."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from ..options import Config, Output, planned
from .report import load

Medium = Literal["talk", "column", "double"]


def figure(
    config: Config,
    medium: Annotated[Medium, typer.Option("--for", help="A slide, a column of 84 mm, or two of 174 mm.")],
    into: Annotated[Path, typer.Option(metavar="FOLDER", help="Where the charts are written.")] = Path("figures"),
    output: Output = None,
) -> None:
    """Draw the charts of a study for a talk or a paper: from its records, or from a committed records.csv."""
    from ...report import Results, facts_of, records_frame
    from ...report.build import print_figures, related
    from ...report.description import describe
    from ...report.story import Report

    study, records, folder, known, _ = load(*next(planned(config, output)))
    facts = facts_of(study)
    results = Results(records_frame(records, facts), facts, related(facts, folder))
    report = Report(results, records, folder, known, describe(study))
    for path in print_figures(report, into, medium):
        print(path)
