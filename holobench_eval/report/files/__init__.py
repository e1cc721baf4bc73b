"""The files of a report for programs and papers: CSV, LaTeX, and the dictionary of their columns."""

from __future__ import annotations

import json
from pathlib import Path

import pandas as pd

from ...core.io import write_atomically
from ..data.board import board
from ..data.results import Results
from ..data.tables import csv_text
from .dictionary import File, dictionary
from .latex import latex_tables
from .tests_csv import comparison_frame


def texts(results: Results) -> dict[str, str]:
    """The text of every file, by its name."""
    frames: dict[File, pd.DataFrame] = {
        "records.csv": results.frame,
        "table.csv": results.table,
        "tests.csv": comparison_frame(results),
    }
    written = {str(name): csv_text(frame) for name, frame in frames.items()}
    drawn = json.dumps(board(results).as_json(), indent=1, ensure_ascii=False, allow_nan=False)
    return written | {
        "board.json": f"{drawn}\n",
        "columns.md": f"{dictionary(frames)}\n",
        "table.tex": latex_tables(results),
    }


def write_files(results: Results, output: Path) -> None:
    """Write records.csv, table.csv, tests.csv, board.json, columns.md and table.tex."""
    for name, text in texts(results).items():
        write_atomically(output / name, text.encode())
