"""``holoeval report``: the report of a study from the records that are there."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..core.errors import UserError
from .options import Config, Output, output_folder
from .output import console, write_report

Print = Annotated[Path | None, typer.Option("--print", help="Draw the charts for print too, into this folder.")]


def report(config: Config, output: Output = None, print_to: Print = None) -> None:
    """Write the report of a study again from its records."""
    from ..report.description import describe
    from ..report.printing import print_figures
    from ..report.section import Report
    from ..study import provenance
    from ..study.config import load_study
    from ..study.plan import plan
    from ..study.store import Store

    study = load_study(config)
    folder = output_folder(study, output)
    store = Store(folder)
    if not store.folder.is_dir():
        raise UserError(f"{folder}: no records in this folder; holoeval run {config} makes them")
    records = store.load(plan(study))
    if all(record["state"] == "missing" for record in records):
        changed = "the study, the code or the metrics that this machine can compute have changed"
        again = f"holoeval run {config} --output {folder}"
        raise UserError(f"{folder}: no cell of this study has a record here ({changed}); {again} computes them")
    known = provenance.read(folder)
    results = write_report(console(), study, records, folder, known)
    if print_to is not None:
        for path in print_figures(Report(results, records, folder, known, describe(study)), print_to):
            print(path)
