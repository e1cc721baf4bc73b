"""The small display of the tests of ``hil`` serves here too."""

import sys
from pathlib import Path

sys.path.append(str(Path(__file__).parents[1] / "hil"))
