"""``holoeval report``: the report of a study from the records that are there."""

from __future__ import annotations

from ..core.errors import UserError
from .options import Config, Output, output_folder
from .output import console, write_report


def report(config: Config, output: Output = None) -> None:
    """Write the report of a study again from its records."""
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
    write_report(console(), study, records, folder, provenance.read(folder))
