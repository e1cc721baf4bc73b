"""Reports: statistics over targets, tables, figures and texts, all computed from the records of a study."""

from .build import build_report as build_report
from .build import recompute_files as recompute_files
from .build import write_report as write_report
from .data.layout import Layout as Layout
from .data.layout import layout_of as layout_of
from .data.results import Results as Results
from .data.tables import committed_records as committed_records
from .data.tables import csv_text as csv_text
from .data.tables import difference as difference
from .data.tables import read_records as read_records
from .data.tables import records_frame as records_frame
from .data.tables import records_text as records_text
from .data.tables import table_from_records as table_from_records
from .description import Description as Description
