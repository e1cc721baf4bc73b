"""A metric that comes after a study was run: a file beside the package's and a name in the list, as contributors do."""

import importlib
import sys
from pathlib import Path

import pytest

from holobench_eval import metrics
from holobench_eval.study import identity

NAME, COLUMN = "peak_error", "peak_error_linear"
FILE = '''
"""Peak error of a pixel."""

from holobench_eval.metrics.base import Metric, paired


def peak_error(image, target):
    """Largest absolute error; images ``(C, H, W)`` or ``(B, C, H, W)`` in [0, 1]."""
    first, second = paired(image, target)
    return (first - second).abs().amax(dim=(1, 2, 3)).reshape(image.shape[:-3]) * SCALE


LOOK = {"title": "Peak error", "unit": "", "digits": 1}
METRIC = Metric("peak_error", "VERSION", "lower", 0.0, ("linear",), peak_error, **LOOK)
'''


def add(folder: Path, patch: pytest.MonkeyPatch, version: int = 1) -> None:
    """Put the metric, at a version, into the catalogue of this test; every version gives other values."""
    (folder / f"{NAME}.py").write_text(FILE.replace("VERSION", str(version)).replace("SCALE", str(version)))
    patch.setattr(metrics, "__path__", [*metrics.__path__, str(folder)])
    patch.setattr(sys, "dont_write_bytecode", True)  # of a file that may be replaced within a second
    importlib.invalidate_caches()
    patch.delitem(sys.modules, f"{metrics.__name__}.{NAME}", raising=False)
    listed = sys.modules[f"{metrics.__name__}.catalogue"]  # the package has a function of that name
    patch.setattr(listed, "NAMES", tuple(dict.fromkeys((*listed.NAMES, NAME))))
    read_anew = getattr(identity.versions, "__wrapped__", identity.versions)  # else once in a process
    patch.setattr(identity, "versions", read_anew)
