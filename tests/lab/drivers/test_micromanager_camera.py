"""Micro-Manager's demo camera, through the real core."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from holobench_eval.core.errors import UserError
from holobench_eval.lab.devices import Camera, DeviceError
from holobench_eval.lab.drivers.catalogue import open_device

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
    camera = open_device("camera", "micromanager", {**params, "properties": {"PixelType": "16bit", "BitDepth": "12"}})
    yield camera
    camera.close()


def test_fresh_counts_are_low_justified_with_the_white_of_their_bits_and_their_exposure(camera: Camera) -> None:
    assert camera.name == "Micro-Manager DCam Lab camera"
    assert (camera.white, camera.exposures) == (4095, (1e-6, 10.0))
    taken = [camera.expose(seconds) for seconds in (0.01, 0.05, 0.02)]
    assert [real for _, real in taken] == pytest.approx([0.01, 0.05, 0.02])
    for frame, _ in taken:
        assert (frame.dtype, frame.shape) == (np.uint16, (512, 512))
        assert 255 < frame.max() <= 4095
    assert not np.array_equal(taken[0][0], taken[1][0])  # the demo camera's waves move
    camera.white = 200.0  # type: ignore[misc]
    with pytest.raises(DeviceError, match="200 are its white"):
        camera.expose(0.02)
    for _ in range(2):
        camera.close()
    with pytest.raises(DeviceError, match="is closed"):
        camera.expose(0.01)


def test_a_colour_camera_gives_red_green_blue(params: dict[str, Any]) -> None:
    camera = open_device(
        "camera", "micromanager", {**params, "properties": {"PixelType": "32bitRGB", "Mode": "Color Test Pattern"}}
    )
    frame, _ = camera.expose(0.01)
    camera.close()
    assert (frame.dtype, frame.shape, camera.white) == (np.uint8, (512, 512, 3), 255)
    assert len({plane.tobytes() for plane in np.moveaxis(frame, 2, 0)}) == 3


def test_floating_point_frames_are_refused(params: dict[str, Any]) -> None:
    with pytest.raises(UserError, match="no 8 or 16 bit counts"):
        open_device("camera", "micromanager", {**params, "properties": {"PixelType": "32bit"}})


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
        open_device("camera", "micromanager", {**params, **change})
    assert "\n" not in str(caught.value)


def test_a_damaged_configuration_is_one_line(params: dict[str, Any]) -> None:
    Path(params["config"]).write_text("Device,Cam,NoSuchLibrary,DCam\n")
    with pytest.raises(UserError, match=r"^driver 'micromanager': .*bench.cfg: [^\n]+$"):
        open_device("camera", "micromanager", params)
