"""columns.md: what every column of a report's files holds."""

from __future__ import annotations

from collections.abc import Mapping

import pandas as pd

from ..data.column import Column
from ..data.meanings import File, column
from ..markdown import Markdown, blocks, code, heading, table


def dictionary(files: Mapping[File, pd.DataFrame]) -> Markdown:
    """A section for every file, a row for every column that it has."""
    parts: list[object] = [
        heading("Columns", 1),
        "Where a column has a unit, the unit is the last part of its name. Numbers have six significant digits, and an "
        "empty cell is an unknown number. Text that a spreadsheet would run as a formula has an apostrophe before it. "
        "records.parquet, where it was written, holds the same as records.csv without these apostrophes.",
    ]
    for file, frame in files.items():
        parts += [
            heading(file),
            table(["column", "meaning", "unit", "type"], [_row(file, str(name)) for name in frame]),
        ]
    return blocks(parts)


def _row(file: File, name: str) -> list[object]:
    found = column(file, name) or Column(name, "Not described", "number")
    return [code(name), Markdown(found.meaning), Markdown(found.unit), found.kind]
