"""A report as it is committed: tables and provenance, without the raw records."""

from __future__ import annotations

import shutil
from pathlib import Path

from holobench_eval.report import layout_of, recompute_files
from holobench_eval.report.data.tables import csv_text, read_records, records_frame
from holobench_eval.study.config import load_study
from holobench_eval.study.run import Outcome


def commit(config: Path, report: Path, outcome: Outcome) -> None:
    """Write the tables of a finished run into its folder, empty texts beside them, and remove its records."""
    layout = layout_of(load_study(config))
    text = csv_text(records_frame(outcome.records, layout))
    _write(report, recompute_files(text, layout))
    for name in ("report.md", "details.md"):
        (report / name).touch()
    shutil.rmtree(report / "records")


def change(config: Path, report: Path, method: str, by: float) -> str:
    """Add to the PSNR of the first cell of a method, in records.csv and in table.csv alike; return its target."""
    path, layout = report / "records.csv", layout_of(load_study(config))
    frame = read_records(path.read_text())
    first = frame.index[frame["label"] == method][0]
    frame.loc[first, "psnr_linear_db"] = round(frame.loc[first, "psnr_linear_db"] + by, 4)
    _write(report, recompute_files(csv_text(frame), layout))
    return str(frame.loc[first, "target"])


def _write(report: Path, texts: dict[str, str]) -> None:
    for name, text in texts.items():
        (report / name).write_text(text)
