"""``holoeval report``: the report of a study from the records that are there."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...core.errors import UserError
from ...core.installed import as_typed
from ..options import Config, Output, planned
from ..output import console, write_report

if TYPE_CHECKING:
    from ...study.definition import Study
    from ...study.plan import Plan


def report(config: Config, output: Output = None) -> None:
    """Write the report of a study and its parts again: from their records, or from a committed records.csv."""
    for each in reversed([*planned(config, output)]):  # the first study's has the answers of its parts
        study, records, folder, known, is_raw = load(*each)
        write_report(console(), study, records, folder, known, keep_pictures=not is_raw)


def load(study: Study, folder: Path, grid: Plan) -> tuple[Study, list[dict[str, Any]], Path, dict[str, Any], bool]:
    """Load what a report is written from: a study, a record for every planned cell, the folder of its report, its
    provenance, and whether the records are those of a run, with pictures, and not a committed records.csv.

    UserError: there are no records, or of another study or code.
    """
    from ...study.running import provenance
    from ...study.store import Store

    store, committed = Store(folder), folder / "records.csv"
    raw, typed = store.folder.is_dir(), shlex.quote(as_typed(study.config))
    if not raw and not committed.is_file():
        raise UserError(f"{folder}: no records in this folder; holoeval run {typed} makes them")
    again = " ".join(filter(None, (f"holoeval run {typed} --output {shlex.quote(str(folder))}", str(study.changes))))
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
    return study, records, folder, known, raw


def _committed(grid: Plan, path: Path, again: str) -> list[dict[str, Any]]:
    """The records of a committed records.csv. UserError: it has other cells than the study plans now."""
    from ...report import committed_records, difference, read_records, records_text

    frame = read_records(records_text(path))
    if differs := difference(frame, grid):
        changed = "the study or the code has changed"
        raise UserError(f"{path.parent}: {differs} ({changed}); {again} computes them")
    return committed_records(frame, grid)
