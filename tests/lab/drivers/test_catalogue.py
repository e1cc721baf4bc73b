"""Devices by the name of their driver: bad names and values are one line, and looking for devices never fails."""

import importlib.metadata
import re
import subprocess
import sys
from dataclasses import replace
from typing import Any

import pytest

from holobench_eval.core.errors import UserError
from holobench_eval.core.installed import installing
from holobench_eval.lab.drivers import catalogue as drivers
from holobench_eval.lab.drivers.catalogue import DRIVERS, checked_params, open_device, survey

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
def test_a_wrong_bench_file_is_one_line_before_any_device_moves(
    kind: Any, driver: str, params: dict[str, Any], message: str
) -> None:
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
def test_a_missing_package_is_told_with_the_command_that_installs_it(
    monkeypatch: pytest.MonkeyPatch, kind: Any, driver: str, params: dict[str, Any], package: str, extra: str
) -> None:
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
