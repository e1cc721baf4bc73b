"""records.parquet: records.csv for programs, with a type for every column.

Writing it takes pyarrow, the optional extra ``parquet``: 170 MB for a file that says what records.csv says, too.
"""

from __future__ import annotations

import importlib.util
import io
from pathlib import Path

import pandas as pd

from ...core.io import write_atomically
from .dictionary import column


def is_available() -> bool:
    """Whether pyarrow is installed."""
    return importlib.util.find_spec("pyarrow") is not None


def write_parquet(path: Path, records: pd.DataFrame) -> None:
    """Write the frame of records.csv: text, float64 with NaN, and int64 with nulls.

    The file has no times and no metadata of pandas: the same records give the same bytes with the same pyarrow.
    """
    import pyarrow
    from pyarrow import parquet

    types = {"text": pyarrow.string(), "count": pyarrow.int64(), "number": pyarrow.float64()}
    columns = {}
    for name in records:
        found = column("records.csv", str(name))
        kind = found.kind if found else "number"
        columns[name] = pyarrow.array(records[name].to_numpy(), types[kind], from_pandas=kind == "count")
    file = io.BytesIO()
    parquet.write_table(pyarrow.table(columns), file, compression="zstd")
    write_atomically(path, file.getvalue())
