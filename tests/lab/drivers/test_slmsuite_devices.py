"""slmsuite's simulated panel and camera, through slmsuite itself."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from holobench_eval.core.errors import UserError
from holobench_eval.lab.devices import DeviceError
from holobench_eval.lab.drivers.catalogue import adopted, open_device
from holobench_eval.lab.drivers.own import Own

pytest.importorskip("slmsuite", reason="slmsuite is not installed: pip install --no-deps slmsuite h5py tqdm")

SHAPE = (120, 160)
PANEL = {"device": "simulated.SimulatedSLM", "arguments": {"resolution": [160, 120], "wav_um": 0.52}}
LEVELS = np.random.default_rng(6).integers(0, 256, SHAPE, dtype=np.uint8)


@pytest.fixture
def slm() -> Iterator[Any]:
    slm = open_device("slm", "slmsuite", PANEL)
    yield slm
    slm.close()


@pytest.fixture
def camera(slm: Any) -> Iterator[Own]:
    """Looks at the far field of the panel."""
    simulated = pytest.importorskip("slmsuite.hardware.cameras.simulated")
    device = simulated.SimulatedCamera(slm._device._slm, bitdepth=12, exposure_bounds_s=(1e-4, 10), gain=0.05)
    camera = adopted("camera", device)
    yield camera
    camera.close()


def test_levels_reach_the_panel_as_they_are_whatever_is_stored_in_slmsuite(slm: Any) -> None:
    assert slm.shape == SHAPE
    slm._device._slm.source["phase"] = np.full(
        SHAPE, 1.0
    )  # a wavefront correction, applied to whatever comes in radians
    slm._device._slm.phase_correct = True
    for levels in (LEVELS, np.arange(256, dtype=np.uint8).repeat(75).reshape(SHAPE)):
        given = levels.copy()
        slm.show(given)
        given[:] = 0  # the caller goes on with the array
        assert np.array_equal(slm._device._slm.display, levels)


def test_levels_of_another_shape_or_type_are_never_cropped_or_converted(slm: Any) -> None:
    for levels in (np.zeros((130, 170), np.uint8), np.zeros(SHAPE, np.float32)):
        with pytest.raises(DeviceError, match="takes uint8 levels"):
            slm.show(levels)


def test_a_panel_that_alters_levels_is_found_out(slm: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(slm._device._slm, "_gray2display", lambda gray: gray // 2)
    with pytest.raises(DeviceError, match="altered the levels"):
        slm.show(LEVELS)


def test_a_panel_of_ten_bits_is_refused() -> None:
    with pytest.raises(UserError, match="takes 10 bits, not 8"):
        open_device("slm", "slmsuite", {**PANEL, "arguments": {**PANEL["arguments"], "bitdepth": 10}})


def test_the_camera_sees_what_the_panel_shows(slm: Any, camera: Own) -> None:
    ramp = (np.arange(160) * 16 % 256).astype(np.uint8)[None].repeat(120, 0)
    bright = []
    for levels in (np.zeros(SHAPE, np.uint8), ramp, ramp[:, ::-1].copy()):
        slm.show(levels)
        frame, _ = camera.expose(0.01)
        assert frame.dtype == np.uint16
        bright.append(np.unravel_index(frame.argmax(), frame.shape)[1])
    assert bright[0] == 80  # the undiffracted spot in the middle, and a grating's on either side of it
    assert bright[1] - 80 == 80 - bright[2] != 0


def test_counts_grow_with_the_exposure_up_to_white(slm: Any, camera: Own) -> None:
    slm.show(LEVELS)
    camera._device._camera.gain = 5000.0  # speckle has less light in one place than a spot
    assert (camera.white, camera.exposures) == (4095, (1e-4, 10))
    totals = []
    for seconds in (0.01, 0.02, 0.04):
        frame, real = camera.expose(seconds)
        assert real == seconds
        totals.append(frame.sum(dtype=float))
    assert np.divide(totals, totals[0]) == pytest.approx([1, 2, 4], rel=0.02)
    assert camera.expose(10.0)[0].max() == 4095


def test_frames_are_not_added_up_whatever_the_camera_is_set_to_and_it_needs_bounds_of_its_exposure(slm: Any) -> None:
    simulated = pytest.importorskip("slmsuite.hardware.cameras.simulated")
    device = simulated.SimulatedCamera(slm._device._slm, bitdepth=8, averaging=4, exposure_bounds_s=(1e-4, 10))
    camera = adopted("camera", device)
    assert camera.white == 255
    assert camera.expose(1.0)[0].max() <= 255
    with pytest.raises(UserError, match="exposure_bounds_s"):
        adopted("camera", simulated.SimulatedCamera(slm._device._slm))


@pytest.mark.parametrize(
    ("device", "message"),
    [
        ("holoeye.Holoeye", "opening failed: ImportError: SDK HEDS not installed"),
        ("holoeye.Holoye", "has no class 'Holoye'; did you mean 'Holoeye'"),
        ("screenmirrored.ScreenMirrored", "take driver 'monitor'"),
        ("simulated.SimulatedSLM", "opening failed: TypeError: .*resolution"),
        ("../simulated", "no slm module"),
    ],
)
@pytest.mark.filterwarnings("ignore:Holoeye SDK")
def test_what_cannot_be_opened_is_one_line(device: str, message: str) -> None:
    with pytest.raises((UserError, DeviceError), match=message) as caught:
        open_device("slm", "slmsuite", {"device": device})
    assert "\n" not in str(caught.value)


def test_nothing_is_written_to_the_standard_output(capsys: pytest.CaptureFixture[str]) -> None:
    slm = open_device("slm", "slmsuite", PANEL)
    slm.show(LEVELS)
    slm.close()
    assert capsys.readouterr().out == ""
