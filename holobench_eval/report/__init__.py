"""Reports: statistics over targets, tables, figures and texts, all computed from the records of a study."""

from .build import build_report as build_report
from .build import recompute_files as recompute_files
from .build import write_report as write_report
from .description import Description as Description
from .facts import Facts as Facts
from .facts import facts_of as facts_of
from .results import Results as Results
from .results import committed_records as committed_records
from .results import csv_text as csv_text
from .results import difference as difference
from .results import read_records as read_records
from .results import records_frame as records_frame
from .results import records_text as records_text
