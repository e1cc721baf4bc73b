"""The package from Python: open a display, solve, capture, score, compare. NumPy in, NumPy out.

A study (``holoeval run``) measures the same with repeats, intervals, tests and a record of every number, and runs the
methods of files in processes of their own; what is here is for a notebook, where all code runs together.
"""

from .described import Array
from .opened import OpenDisplay, open_bench, open_display
from .pictures import compare, load_records, picture, save_levels, score

__all__ = [
    "Array",
    "OpenDisplay",
    "compare",
    "load_records",
    "open_bench",
    "open_display",
    "picture",
    "save_levels",
    "score",
]
