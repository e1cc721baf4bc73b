"""Micro-Manager's demo camera, through the real core."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from holobench_eval.core.errors import UserError
from holobench_eval.lab.devices import Camera, DeviceError
from holobench_eval.lab.drivers.catalogue import open_camera

CONFIG = """
Property,Core,Initialize,0
Device,Lab camera,DemoCamera,DCam
Device,Shutter,DemoCamera,DShutter
Property,Core,Initialize,1
Property,Core,Camera,Lab camera
"""


@pytest.fixture
def params(tmp_path: Path) -> dict[str, Any]:
    pytest.importorskip("pymmcore_plus")
    adapters = pytest.importorskip("mm_test_adapters")
    (tmp_path / "bench.cfg").write_text(CONFIG)
    return {"config": str(tmp_path / "bench.cfg"), "adapters": adapters.device_adapter_path()}


@pytest.fixture
def camera(params: dict[str, Any]) -> Iterator[Camera]:
    camera = open_camera("micromanager", {**params, "properties": {"PixelType": "16bit", "BitDepth": "12"}})
    yield camera
    camera.close()


def test_counts_are_low_justified_with_the_white_of_the_bit_depth(camera: Camera) -> None:
    assert camera.name == "Micro-Manager DCam Lab camera"
    assert camera.white == 4095
    frame, _ = camera.expose(0.02)
    assert (frame.dtype, frame.shape) == (np.uint16, (512, 512))
    assert 255 < frame.max() <= 4095


def test_the_exposure_is_set_and_told(camera: Camera) -> None:
    assert camera.exposures == (1e-6, 10.0)
    assert [camera.expose(seconds)[1] for seconds in (0.01, 0.05, 0.02)] == pytest.approx([0.01, 0.05, 0.02])


def test_frames_are_fresh(camera: Camera) -> None:
    first, _ = camera.expose(0.01)
    assert not np.array_equal(first, camera.expose(0.01)[0])  # the demo camera's waves move


def test_a_colour_camera_gives_red_green_blue(params: dict[str, Any]) -> None:
    camera = open_camera(
        "micromanager", {**params, "properties": {"PixelType": "32bitRGB", "Mode": "Color Test Pattern"}}
    )
    frame, _ = camera.expose(0.01)
    camera.close()
    assert (frame.dtype, frame.shape, camera.white) == (np.uint8, (512, 512, 3), 255)
    assert len({plane.tobytes() for plane in np.moveaxis(frame, 2, 0)}) == 3


def test_floating_point_frames_are_refused(params: dict[str, Any]) -> None:
    with pytest.raises(UserError, match="no 8 or 16 bit counts"):
        open_camera("micromanager", {**params, "properties": {"PixelType": "32bit"}})


def test_a_camera_that_counts_beyond_its_white_is_refused(camera: Camera) -> None:
    camera.white = 200.0  # type: ignore[misc]
    with pytest.raises(DeviceError, match="200 are its white"):
        camera.expose(0.02)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"camera": "Lab camra"}, "no camera 'Lab camra' in it; did you mean 'Lab camera'"),
        ({"camera": "Shutter"}, "no camera 'Shutter' in it"),
        ({"properties": {"PixelTyp": "16bit"}}, "no property 'PixelTyp'; did you mean 'PixelType'"),
        ({"properties": {"PixelType": "15bit"}}, "property 'PixelType' cannot be '15bit'; allowed: 16bit, "),
        ({"config": "nowhere.cfg"}, "no such configuration: nowhere.cfg"),
        ({"adapters": "nowhere"}, "no such folder of adapters: nowhere"),
    ],
)
def test_what_is_wrong_in_the_bench_file_is_one_line(params: dict[str, Any], change: dict, message: str) -> None:
    with pytest.raises(UserError, match=message) as caught:
        open_camera("micromanager", {**params, **change})
    assert "\n" not in str(caught.value)


def test_a_damaged_configuration_is_one_line(params: dict[str, Any]) -> None:
    Path(params["config"]).write_text("Device,Cam,NoSuchLibrary,DCam\n")
    with pytest.raises(UserError, match=r"^driver 'micromanager': .*bench.cfg: [^\n]+$"):
        open_camera("micromanager", params)


def test_a_closed_camera_says_so(camera: Camera) -> None:
    camera.close()
    camera.close()
    with pytest.raises(DeviceError, match="is closed"):
        camera.expose(0.01)
