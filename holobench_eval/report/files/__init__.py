"""The files of a report for programs and papers: CSV, Parquet, LaTeX, and the dictionary of their columns."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from ...core.io import write_atomically
from ..data.columns import File
from ..data.results import Results
from ..data.tables import csv_text
from .dictionary import dictionary
from .latex import latex_tables
from .parquet import is_available, write_parquet
from .tidy import tidy_records, tidy_table, tidy_tests


def write_files(results: Results, output: Path) -> None:
    """Write records.csv, table.csv, tests.csv, columns.md, table.tex and, with pyarrow, records.parquet."""
    records = tidy_records(results.frame, results.layout)
    files: dict[File, pd.DataFrame] = {
        "records.csv": records,
        "table.csv": tidy_table(results),
        "tests.csv": tidy_tests(results),
    }
    for name, frame in files.items():
        write_atomically(output / name, csv_text(frame).encode())
    write_atomically(output / "columns.md", f"{dictionary(files)}\n".encode())
    write_atomically(output / "table.tex", latex_tables(results).encode())
    parquet = output / "records.parquet"
    if is_available():
        write_parquet(parquet, records)
    else:
        parquet.unlink(missing_ok=True)  # of other records
