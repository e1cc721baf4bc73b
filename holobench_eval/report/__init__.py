"""Reports: statistics over targets, tables, figures and texts, all computed from the records of a study."""

from .build import build_report, recompute_files, write_report
from .data.layout import Layout, layout_of
from .data.results import Results
from .data.tables import (
    committed_records,
    csv_text,
    difference,
    read_records,
    records_frame,
    records_text,
    table_from_records,
)
from .description import Description

__all__ = [
    "Description",
    "Layout",
    "Results",
    "build_report",
    "committed_records",
    "csv_text",
    "difference",
    "layout_of",
    "read_records",
    "recompute_files",
    "records_frame",
    "records_text",
    "table_from_records",
    "write_report",
]
