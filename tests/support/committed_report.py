"""A report as it is committed: tables and provenance, without the raw records."""

from __future__ import annotations

import shutil
from pathlib import Path

from holobench_eval.report import layout_of, recompute_table
from holobench_eval.report.data.tables import csv_text, read_records, records_frame
from holobench_eval.study.config import load_study
from holobench_eval.study.run import Outcome


def commit(config: Path, report: Path, outcome: Outcome) -> None:
    """Write the tables of a finished run into its folder, empty texts beside them, and remove its records."""
    layout = layout_of(load_study(config))
    text = csv_text(records_frame(outcome.records, layout))
    (report / "records.csv").write_text(text)
    (report / "table.csv").write_text(recompute_table(text, layout))
    for name in ("report.md", "details.md"):
        (report / name).touch()
    shutil.rmtree(report / "records")


def change(config: Path, report: Path, method: str, by: float) -> str:
    """Add to the PSNR of the first cell of a method, in records.csv and in table.csv alike; return its target."""
    path, layout = report / "records.csv", layout_of(load_study(config))
    frame = read_records(path.read_text())
    first = frame.index[frame["method"] == method][0]
    frame.loc[first, "psnr_linear"] = round(frame.loc[first, "psnr_linear"] + by, 4)
    path.write_text(csv_text(frame))
    (report / "table.csv").write_text(recompute_table(path.read_text(), layout))
    return str(frame.loc[first, "target"])
