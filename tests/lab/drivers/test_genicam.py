"""docs/drivers/genicam_camera.py, an own camera: on harvesters as it is documented, and on GenICam's simulator."""

import importlib.util
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest

from holobench_eval.core.errors import UserError
from holobench_eval.lab.devices import DeviceError
from holobench_eval.lab.drivers import driver
from holobench_eval.lab.drivers.catalogue import open_device

EXAMPLE = f"{Path(__file__).parents[3] / 'docs' / 'drivers' / 'genicam_camera.py'}:GenicamCamera"
MILLISECOND = 1e3  # in GenICam's unit


class Acquirer:
    """What ``Harvester.create`` gives, by the documentation of harvesters 1.4: a camera with 40 x 60 samples."""

    def __init__(self) -> None:
        self.exposure = SimpleNamespace(value=1e4, min=20.0, max=1e6)
        auto = SimpleNamespace(value="Continuous")
        nodes = SimpleNamespace(PixelFormat=SimpleNamespace(value="Mono8"), ExposureTime=self.exposure, GainAuto=auto)
        self.remote_device, self.running, self.calls = SimpleNamespace(node_map=nodes), False, list[str]()

    def start(self) -> None:
        self.running, self.exposure.value = True, 10 * round(self.exposure.value / 10)

    def stop(self) -> None:
        self.running = False

    @contextmanager
    def fetch(self, *, timeout: float = 0) -> Iterator[Any]:
        assert self.running
        assert timeout > self.exposure.value / 1e6
        if self.exposure.value > 5e5:
            raise TimeoutError("no buffer")
        data = np.full(40 * 60, self.exposure.value / MILLISECOND, np.uint16)
        yield SimpleNamespace(payload=SimpleNamespace(components=[SimpleNamespace(data=data, width=60, height=40)]))
        data[:] = 0  # the buffer is queued again

    def destroy(self) -> None:
        self.calls.append("destroy")


@pytest.fixture
def acquirer(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Acquirer:
    """Behind a module that stands for harvesters; the producer is ``producer.cti``."""
    camera, core = Acquirer(), ModuleType("harvesters.core")
    serials = [SimpleNamespace(model="Lynx", serial_number=number) for number in ("7", "8")]
    core.Harvester = lambda: SimpleNamespace(  # type: ignore[attr-defined]
        add_file=camera.calls.append,
        update=lambda: None,
        device_info_list=serials,
        create=lambda index: camera,
        reset=lambda: camera.calls.append("reset"),
    )
    driver._imported.cache_clear()
    monkeypatch.setitem(sys.modules, "harvesters", ModuleType("harvesters"))
    monkeypatch.setitem(sys.modules, "harvesters.core", core)
    (tmp_path / "producer.cti").touch()
    monkeypatch.chdir(tmp_path)
    return camera


def test_frames_are_counts_of_the_exposure_that_was_set_and_what_helps_is_off(acquirer: Acquirer) -> None:
    camera = open_device("camera", EXAMPLE, {"producer": "producer.cti", "serial": "8"})
    nodes = acquirer.remote_device.node_map
    assert (camera.name, camera.white, camera.exposures) == ("Lynx 8", 4095, (20e-6, 1.0))
    assert (nodes.PixelFormat.value, nodes.GainAuto.value) == ("Mono12", "Off")
    frame, seconds = camera.expose(0.3)
    assert (frame.shape, frame.dtype, int(frame.min()), seconds) == ((40, 60), np.uint16, 300, 0.3)
    with pytest.raises(DeviceError, match="Lynx 8: taking a picture failed: TimeoutError: no buffer"):
        camera.expose(0.6)
    assert not acquirer.running
    camera.close()
    assert acquirer.calls == ["producer.cti", "destroy", "reset"]


@pytest.mark.parametrize(
    ("params", "error", "line"),
    [
        ({"producer": "producer.cti"}, DeviceError, "ValueError: 2 cameras ''; found: Lynx 7, Lynx 8"),
        ({"producer": "none.cti"}, DeviceError, "none.cti: no such file"),
        ({}, UserError, "needs the parameter 'producer'"),
        ({"producer": "producer.cti", "pixel_format": "BayerRG8"}, UserError, "parameter 'pixel_format': .* 'Mono12'"),
    ],
)
def test_what_cannot_be_opened_is_one_line(acquirer: Acquirer, params: Any, error: Any, line: str) -> None:
    with pytest.raises(error, match=line) as caught:
        open_device("camera", EXAMPLE, params)
    assert "\n" not in str(caught.value)


def test_the_simulator_of_genicam_gives_frames(monkeypatch: pytest.MonkeyPatch) -> None:
    core = pytest.importorskip("harvesters.core", reason="pip install harvesters genicam, which brings a simulator")
    producer = next(Path(importlib.util.find_spec("genicam").origin).parent.glob("*.cti"))  # type: ignore[union-attr, arg-type]
    driver._imported.cache_clear()
    create = core.Harvester.create

    def with_an_exposure(self: Any, index: int) -> Any:  # which the simulator lacks
        camera = create(self, index)
        own = SimpleNamespace(value=1e4, min=10.0, max=1e6)
        nodes = SimpleNamespace(PixelFormat=camera.remote_device.node_map.PixelFormat, ExposureTime=own)
        device, calls = SimpleNamespace(node_map=nodes), ("start", "fetch", "stop", "destroy")
        return SimpleNamespace(remote_device=device, **{name: getattr(camera, name) for name in calls})

    monkeypatch.setattr(core.Harvester, "create", with_an_exposure)
    camera = open_device("camera", EXAMPLE, {"producer": str(producer), "serial": "1", "pixel_format": "Mono8"})
    for _ in range(2):
        frame, seconds = camera.expose(0.02)
        assert (frame.shape, frame.dtype, seconds) == ((400, 400), np.uint8, 0.02)
        assert frame.min() < frame.max()
    assert camera.name == "Viky 1"
    camera.close()
