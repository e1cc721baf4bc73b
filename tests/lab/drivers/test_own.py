"""A lab's own panel and camera: what they have to have, their parameters, and how what is wrong is told."""

import re
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from holobench_eval.core.errors import UserError
from holobench_eval.lab.devices import DeviceError, SequenceSlm
from holobench_eval.lab.drivers.catalogue import adopted, checked_params, open_device

FILE = '''
import threading
from dataclasses import dataclass, field
from typing import Annotated, Literal

import numpy as np
from annotated_types import Interval

shown = []


@dataclass
class Camera:
    """A camera that is a dataclass; it gives what the panel of the same file shows."""

    serial: str
    gain: Annotated[float, Interval(ge=0, le=4)] = 1.0
    region: tuple[int, int] = (4, 6)
    notes: list[str] = field(default_factory=list)
    white, exposures = np.float64(255), np.array([1e-4, 1.0])

    def expose(self, seconds):
        shown.append(threading.get_ident())
        return np.full(self.region, shown[0][0, 0] * self.gain, np.uint8), seconds


class Panel:
    name = "wall"

    def __init__(self, *, mode: Literal["fast", "slow"] = "slow"):
        self.mode, self.shape = mode, np.zeros((4, 6)).shape

    def show(self, levels):
        shown[:] = [levels]

    def close(self):
        shown.append("closed")


class Broken:
    def __init__(self, **others):
        pass


class Refuses:
    def __init__(self):
        raise OSError("no\\nlicence")
'''


@pytest.fixture
def own(tmp_path: Path) -> str:
    (tmp_path / "mine.py").write_text(FILE)
    return str(tmp_path / "mine.py")


def test_a_panel_and_a_camera_of_one_file_know_of_each_other_and_live_on_a_thread_each(own: str) -> None:
    panel = open_device("slm", f"{own}:Panel", {"mode": "fast"})
    camera = open_device("camera", f"{own}:Camera", {"serial": "7", "gain": 2, "region": [2, 3]})
    assert (panel.name, panel.shape, isinstance(panel, SequenceSlm)) == ("wall", (4, 6), False)
    assert (camera.name, camera.white, camera.exposures) == ("camera Camera", 255, (1e-4, 1.0))
    levels = np.full((4, 6), 5, np.uint8)
    panel.show(levels)
    levels[:] = 9  # the caller goes on with the array
    frame, seconds = camera.expose(0.5)
    assert (frame.shape, int(frame.max()), seconds) == ((2, 3), 10, 0.5)
    camera.expose(0.5)
    shown = panel._device.show.__globals__["shown"]
    assert len({*shown[1:], threading.get_ident()}) == 2
    with pytest.raises(DeviceError, match=r"wall takes uint8 levels of \(4, 6\)"):
        panel.show(levels[1:])
    panel.close()
    panel.close()
    camera.close()
    assert [each for each in shown if isinstance(each, str)] == ["closed"]
    with pytest.raises(DeviceError, match="camera Camera is closed"):
        camera.expose(0.5)


@pytest.mark.parametrize(
    ("driver", "params", "line"),
    [
        ("Camera", {}, "needs the parameter 'serial'"),
        ("Camera", {"serial": 7}, "parameter 'serial': .* got 7"),
        ("Camera", {"serial": "7", "gian": 1}, "has no parameter 'gian'; did you mean 'gain'"),
        ("Camera", {"serial": "7", "gain": 5}, "parameter 'gain': .* less than or equal to 4, got 5"),
        ("Camra", {}, "'Camra' of .*mine.py is not there; did you mean 'Camera'"),
        ("shown", {}, "'shown' of .*mine.py is no class or function; allowed: .*Camera"),
        ("Broken", {}, r"'\*\*others' takes any parameters"),
        ("", {}, "'' of .*mine.py is not there"),
    ],
)
def test_a_wrong_name_or_parameter_is_one_line_before_any_device_moves(
    own: str, driver: str, params: dict[str, Any], line: str
) -> None:
    with pytest.raises(UserError, match=line) as caught:
        checked_params("camera", f"{own}:{driver}", params)
    assert "\n" not in str(caught.value)


def test_what_cannot_be_opened_is_one_line(own: str, tmp_path: Path) -> None:
    (tmp_path / "bad.py").write_text("import an_sdk_that_is_not_installed\n")
    for driver, line in (
        (f"{own}:Refuses", ":Refuses': opening failed: OSError: no licence"),
        (f"{own}:Panel", "wall: it has no 'expose'; expected expose"),
        (f"{tmp_path}/bad.py:Mine", "cannot be imported: ModuleNotFoundError: No module named 'an_sdk"),
        (f"{tmp_path}/none.py:Mine", "cannot be imported: FileNotFoundError"),
        ("tests.lab.drivers.test_own:Whole", "needs the parameter 'white'"),
    ):
        with pytest.raises((UserError, DeviceError), match=line) as caught:
            open_device("camera", driver, {})
        assert "\n" not in str(caught.value)


class Whole:
    """A camera with all it needs, of which a test takes something."""

    name, exposures = "cam", (1e-4, 1.0)

    def __init__(self, white: float) -> None:
        self.white, self.given = white, (np.zeros((3, 4), np.uint16), 0.1)

    def expose(self, seconds: float) -> Any:
        """What it is told to give."""
        return self.given


@pytest.mark.parametrize(
    ("key", "value", "line"),
    [
        ("white", None, "cam: white is None; expected the counts of a saturated sample"),
        ("white", 0, "cam: white is 0"),
        ("white", 2**20, "cam: white is 1048576"),
        ("exposures", 1.0, "cam: exposures is 1.0; expected (shortest, longest) in seconds"),
        ("exposures", (1.0, 0.1), "cam: exposures is (1.0, 0.1)"),
        ("expose", 1.0, "cam: expose is 1.0; expected expose(seconds), which returns (counts, seconds)"),
    ],
)
def test_what_a_camera_lacks_is_said_with_what_would_be_right(key: str, value: Any, line: str) -> None:
    camera = Whole(4095)
    setattr(camera, key, value)
    with pytest.raises(UserError, match=re.escape(line)):
        adopted("camera", camera)


def test_a_class_and_an_object_that_fails_are_no_open_devices() -> None:
    class Unplugged:
        @property
        def name(self) -> str:
            raise OSError("unplugged")

    for device, line in (
        (Whole, "camera is the class Whole; expected an open device of it"),
        (Unplugged(), "camera: opening failed: OSError: unplugged"),
    ):
        with pytest.raises(UserError, match=line):
            adopted("camera", device)


@pytest.mark.parametrize(
    ("given", "line"),
    [
        (np.zeros((3, 4), np.uint16), "expose returned ndarray; expected (counts, seconds)"),
        ((np.zeros((3, 4), np.uint16), None), "expose returned ndarray, NoneType; expected (counts, seconds)"),
        ((0.1, np.zeros((3, 4), np.uint16)), "expose returned float, ndarray; expected (counts, seconds)"),
        (([[1, 2], [3]], 0.1), "expose returned list, float; expected (counts, seconds)"),
        (None, "expose returned NoneType"),
        (
            ([[1, 2]], 0.1),
            "gave int64 of (1, 2); expected whole counts, uint8 or uint16 of (H, W) or (H, W, 3)",
        ),
        ((np.zeros((3, 4, 4), np.uint8), 0.1), "gave uint8 of (3, 4, 4)"),
        ((np.full((3, 4), 4096, np.uint16), 0.1), "gave 4096 counts, but 4095 are its white"),
    ],
)
def test_what_is_no_photograph_is_a_device_error(given: Any, line: str) -> None:
    camera = Whole(4095)
    camera.given = given
    with pytest.raises(DeviceError, match=re.escape(line)):
        adopted("camera", camera).expose(0.1)


class Theirs:
    """slmsuite's interface, of a camera."""

    name, bitresolution, exposure_bounds_s = "theirs", 4096, (1e-4, 1.0)

    def set_exposure(self, seconds: float) -> float:
        """The exposure that it takes."""
        self.seconds = seconds
        return seconds

    def flush(self) -> None:
        """Nothing waits."""

    def get_image(self, **_: Any) -> Any:
        """Counts that grow with time."""
        return np.full((3, 4), 1000 * self.seconds, np.uint16)

    def close(self) -> None:
        """Nothing to do."""


def test_a_class_with_slmsuites_interface_is_taken_from_a_module_a_file_and_as_an_object(tmp_path: Path) -> None:
    (tmp_path / "theirs.py").write_text(f"from {__name__} import Theirs\n\n\nclass Less:\n    name = 'less'\n")
    devices = [f"{__name__}:Theirs", f"{tmp_path}/theirs.py:Theirs"]
    for camera in (
        *(open_device("camera", "slmsuite", {"device": each}) for each in devices),
        adopted("camera", Theirs()),
    ):
        assert (camera.name, camera.white, camera.exposures) == ("slmsuite theirs", 4095, (1e-4, 1.0))
        frame, seconds = camera.expose(0.5)
        assert (int(frame.max()), seconds) == (500, 0.5)
        camera.close()
    with pytest.raises(
        DeviceError, match="'slmsuite': opening failed: AttributeError: 'Less' object has no attribute 'close'"
    ):
        open_device("camera", "slmsuite", {"device": f"{tmp_path}/theirs.py:Less"})
