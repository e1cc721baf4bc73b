"""The package from Python: open a display, solve, capture, score, compare. NumPy in, NumPy out.

A study (``holoeval run``) measures the same with repeats, intervals, tests and a record of every number, and runs the
methods of files in processes of their own; what is here is for a notebook, where all code runs together.
"""

from .described import Array as Array
from .opened import OpenDisplay as OpenDisplay
from .opened import open_bench as open_bench
from .opened import open_display as open_display
from .pictures import compare as compare
from .pictures import load_records as load_records
from .pictures import picture as picture
from .pictures import save_levels as save_levels
from .pictures import score as score
