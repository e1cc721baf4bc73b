"""Devices by the name of their driver: bad names and values are one line, and looking for devices never fails."""

import importlib.metadata
import re
import subprocess
import sys
import threading
import time
from dataclasses import replace

import pytest

from holobench_eval.core.errors import UserError
from holobench_eval.core.installed import installing
from holobench_eval.lab.devices import DeviceError
from holobench_eval.lab.drivers import catalogue as drivers
from holobench_eval.lab.drivers.catalogue import DRIVERS, checked_params, open_device, survey
from holobench_eval.lab.drivers.worker import Worker
from tests.support.patience import PATIENCE

MONITOR = {"name": "HDMI-1", "resolution": [1920, 1080]}
OPENCV = {"device": 0, "resolution": [64, 48]}


def test_importing_the_drivers_imports_none_of_their_packages() -> None:
    packages = "{'pyglet', 'slmsuite', 'gphoto2', 'rawpy', 'pymmcore_plus'}"
    code = f"import sys, holobench_eval.lab.drivers.catalogue; print(sorted({packages} & set(sys.modules)))"
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert answer.stdout == "[]\n"


@pytest.mark.parametrize(
    ("kind", "driver", "params", "message"),
    [
        ("slm", "moniter", {}, "unknown slm driver 'moniter'; did you mean 'monitor'. allowed: monitor, slmsuite"),
        ("slm", "monitor", {**MONITOR, "index": 1}, "driver 'monitor' has no parameter 'index'; allowed: check, name"),
        ("slm", "monitor", {"name": "HDMI-1"}, "slm driver 'monitor' needs the parameter 'resolution'"),
        ("slm", "monitor", {**MONITOR, "resolution": [0, 1080]}, "parameter 'resolution.0': .* got 0"),
        ("slm", "monitor", {**MONITOR, "check": "no"}, "parameter 'check': .* got 'no'"),
        ("slm", "monitor", {**MONITOR, "name": {1, 2}}, "slm driver 'monitor': .*set"),
        ("camera", "opencv", {**OPENCV, "exposures": [1, float("nan")]}, "exposures.1"),
        ("camera", "opencv", {**OPENCV, "exposures": [1, 0.1]}, "shortest and the longest"),
        ("camera", "opencv", {**OPENCV, "exposures": [0.1, 1], "bits": 12}, "GREY has 8 bits"),
        ("camera", "micromanager", {"config": ""}, "parameter 'config'"),
    ],
)
def test_a_wrong_bench_file_is_one_line_before_any_device_moves(kind, driver, params, message) -> None:
    for check in (lambda: checked_params(kind, driver, params), lambda: open_device(kind, driver, params)):
        with pytest.raises(UserError, match=message) as caught:
            check()
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("kind", "driver", "params", "package", "extra"),
    [
        ("slm", "monitor", MONITOR, "pyglet", "monitor"),
        ("slm", "slmsuite", {"device": "holoeye.Holoeye"}, "slmsuite", "slmsuite"),
        ("camera", "gphoto2", {}, "gphoto2", "gphoto2"),
        ("camera", "gphoto2", {}, "rawpy", "raw"),
        ("camera", "micromanager", {"config": __file__}, "pymmcore_plus", "micromanager"),
    ],
)
def test_a_missing_package_is_told_with_its_command(monkeypatch, kind, driver, params, package, extra) -> None:
    _hide(monkeypatch, package)
    if package == "rawpy":
        pytest.importorskip("gphoto2")
    with pytest.raises(UserError, match=re.escape(installing(extra=extra))):
        open_device(kind, driver, params)


def _hide(monkeypatch: pytest.MonkeyPatch, package: str) -> None:
    for name in [name for name in sys.modules if name.split(".")[0] == package]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, package, None)


def test_every_driver_is_listed_with_its_version_and_what_to_do(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    listed = survey()
    known = [(kind, name) for kind, drivers in DRIVERS.items() for name in drivers]
    assert [(entry.kind, entry.driver) for entry in listed] == known
    assert all(entry.devices or entry.why for entry in listed)
    assert all("\n" not in entry.why for entry in listed)
    opencv = next(entry for entry in listed if entry.driver == "opencv")
    assert opencv.version == importlib.metadata.version("opencv-python-headless")


def test_looking_for_devices_survives_broken_packages(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(drivers, "installed", lambda _: None)
    assert all(entry.version is None and "pip install" in entry.why for entry in survey())
    monkeypatch.setattr(drivers, "installed", lambda _: "1.0")

    def broken() -> list[str]:
        raise OSError("libusb\nis missing")

    for table in DRIVERS.values():
        for name, driver in list(table.items()):
            monkeypatch.setitem(table, name, replace(driver, answering=broken))
    assert {entry.why for entry in survey()} == {"OSError: libusb is missing"}


def test_every_call_and_the_idling_between_are_on_one_thread_that_is_not_the_callers() -> None:
    idled: list[int] = []
    worker = Worker("panel")
    worker.idle = lambda: idled.append(threading.get_ident())
    threads = {worker.call("a call", PATIENCE, threading.get_ident) for _ in range(3)}
    deadline = time.monotonic() + PATIENCE
    while not idled and time.monotonic() < deadline:
        time.sleep(0.01)
    worker.stop(1, lambda: None)
    assert threads == set(idled)
    assert threads != {threading.get_ident()}


def test_a_call_that_never_returns_is_left_behind_and_the_device_is_not_asked_again() -> None:
    worker, forever = Worker("camera"), threading.Event()
    began = time.monotonic()
    with pytest.raises(DeviceError, match=r"camera: taking a picture took longer than 0\.2 s"):
        worker.call("taking a picture", 0.2, forever.wait)
    with pytest.raises(DeviceError, match="took longer"):
        worker.call("taking a picture", PATIENCE, lambda: None)
    worker.stop(PATIENCE, forever.wait)
    assert time.monotonic() - began < PATIENCE / 2
    forever.set()


def test_what_a_library_raises_becomes_one_line_and_users_errors_stay() -> None:
    def broken(error: Exception) -> None:
        raise error

    worker = Worker("camera")
    with pytest.raises(DeviceError, match=r"^camera: reading failed: OSError: a b$"):
        worker.call("reading", 5, lambda: broken(OSError("a\n  b")))
    with pytest.raises(DeviceError, match="reading failed: TimeoutError"):
        worker.call("reading", 5, lambda: broken(TimeoutError("its own")))
    with pytest.raises(UserError, match=r"^no such camera$"):
        worker.call("reading", 5, lambda: broken(UserError("no such camera")))
    assert worker.call("reading", 5, lambda: 7) == 7
    worker.stop(5, lambda: broken(OSError()))
    with pytest.raises(DeviceError, match="camera is closed"):
        worker.call("reading", 5, lambda: 7)
