"""``holoeval report``: the report of a study from the records that are there."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ...core.errors import UserError
from ...core.installed import as_typed
from ..options import Config, Output, output_folder
from ..output import console, write_report

if TYPE_CHECKING:
    from ...study.plan import Plan

Print = Annotated[Path | None, typer.Option("--print", help="Draw the charts for print too, into this folder.")]


def report(config: Config, output: Output = None, print_to: Print = None) -> None:
    """Write the report of a study again: from its records, or from a committed records.csv."""
    from ...report.description import describe
    from ...report.printing import print_figures
    from ...report.section import Report
    from ...study import provenance
    from ...study.changes import recorded
    from ...study.config import load_study
    from ...study.plan import plan
    from ...study.store import Store

    changes = recorded(provenance.read(output)) if output else None
    study = load_study(config, changes)
    folder, grid = output_folder(study, output), plan(study)
    store, committed = Store(folder), folder / "records.csv"
    raw, typed = store.folder.is_dir(), shlex.quote(as_typed(config))
    if not raw and not committed.is_file():
        raise UserError(f"{folder}: no records in this folder; holoeval run {typed} makes them")
    again = " ".join(filter(None, (f"holoeval run {typed} --output {shlex.quote(str(folder))}", str(changes or ""))))
    records = store.load(grid) if raw else _committed(grid, committed, again)
    missing = sum(record["state"] == "missing" for record in records)
    if missing == len(records):
        changed = "the study or the code has changed"
        raise UserError(f"{folder}: no cell of this study has a record here ({changed}); {again} computes them")
    if not any(study.headline in record["scores"] for record in records if record["state"] == "done"):
        raise UserError(
            f"{folder}: no score '{study.headline}' of today's versions (protocol {study.protocol.version}); "
            f"holoeval rescore {typed} --output {shlex.quote(str(folder))} makes it from the kept captures"
        )
    known = provenance.read(folder) if missing else provenance.restate(folder, study, grid, as_scored=not raw)
    results = write_report(console(), study, records, folder, known, keep_pictures=not raw)
    if print_to is not None:
        for path in print_figures(Report(results, records, folder, known, describe(study)), print_to):
            print(path)


def _committed(grid: Plan, path: Path, again: str) -> list[dict[str, Any]]:
    """The records of a committed records.csv. UserError: it has other cells than the study plans now."""
    from ...report import committed_records, difference, read_records, records_text

    frame = read_records(records_text(path))
    if differs := difference(frame, grid):
        changed = "the study or the code has changed"
        raise UserError(f"{path.parent}: {differs} ({changed}); {again} computes them")
    return committed_records(frame, grid)
