"""A new driver is one file and its name in the catalogue: nothing else knows how many there are."""

from pathlib import Path

import numpy as np
import pytest

from holobench_eval.core.errors import UserError
from holobench_eval.lab import drivers
from holobench_eval.lab.drivers import catalogue

FILE = """
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Interval

from .driver import Driver


@dataclass(frozen=True)
class LineSettings:
    pixels: Annotated[int, Interval(ge=1)] = 8


class LineCamera:
    white, exposures = 255, (0.1, 1.0)

    def __init__(self, settings):
        self.pixels = settings.pixels

    def expose(self, seconds):
        return np.full((1, self.pixels), round(100 * seconds), np.uint8), seconds


DRIVERS = (Driver("camera", "line", LineSettings, LineCamera, "numpy", "", lambda: ["line camera 1"]),)
"""


def test_one_file_and_one_line_make_a_driver(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "line_camera.py").write_text(FILE)
    monkeypatch.setattr(drivers, "__path__", [*drivers.__path__, str(tmp_path)])
    modules = (*catalogue.MODULES, "line_camera")
    monkeypatch.setitem(catalogue.DRIVERS, "camera", catalogue.drivers_in(modules, "camera"))
    camera = catalogue.open_device("camera", "line", {"pixels": 5})
    frame, seconds = camera.expose(0.5)
    assert (frame.shape, int(frame.max()), seconds) == ((1, 5), 50, 0.5)
    with pytest.raises(UserError, match="camera driver 'line' has no parameter 'pixel'; did you mean 'pixels'"):
        catalogue.checked_params("camera", "line", {"pixel": 5})
    with pytest.raises(UserError, match="parameter 'pixels': input should be greater than or equal to 1, got 0"):
        catalogue.open_device("camera", "line", {"pixels": 0})
    entry = next(entry for entry in catalogue.survey() if entry.driver == "line")
    assert (entry.kind, entry.version, entry.devices, entry.why) == ("camera", np.__version__, ("line camera 1",), "")


def test_every_driver_of_a_file_is_in_the_catalogue() -> None:
    folder = Path(catalogue.__file__).parent
    listing = {file.stem for file in folder.glob("*.py") if "\nDRIVERS = " in file.read_text()}
    assert listing == set(catalogue.MODULES)
