"""What ``holoeval doctor`` says of the pictures of a camera and a panel."""

import re
from pathlib import Path

import numpy as np
import pytest

from holobench_eval.commands.own.new import write_code
from holobench_eval.lab.trial import tried
from holobench_eval.testing import table
from tests.lab.session.running import run


@pytest.fixture
def devices(tmp_path: Path) -> list[str]:
    """A camera and a panel, as they are written."""
    return [write_code(f"my_{kind}", tmp_path, kind)[2] for kind in ("camera", "panel")]


def said(names: list[str]) -> tuple[str, bool]:
    """All lines, and whether all is well."""
    checks = list(tried(names, wait=lambda _: None))
    return "\n".join(check.line for check in checks), all(check.passed for check in checks)


def test_pictures_are_described(devices: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    grab = table.grab

    def hot(seconds: float, bits: int) -> np.ndarray:
        frame = grab(seconds, bits)
        frame[50:60:3, 70] = 4000
        return frame

    monkeypatch.setattr(table, "grab", hot)
    text, well = said(devices)
    assert well, text
    for line in (
        "simulated panel: 128 x 128 pixels",
        "simulated camera: 201 x 201 samples of uint16, no old frames",
        "counts: up to 4095 of 4095, 12 bits",
        r"black: 6\d\.\d counts",
        r"exposure: 0\.0\d+ s, 0\.00% of the samples saturated",
        "hot pixels: 4",
        r"linearity: r\^2 1\.0000",
        r"settling: \d+ ms",
    ):
        assert re.search(f"^{line}", text, re.MULTILINE), text


@pytest.mark.parametrize(
    ("fault", "line"),
    [
        (lambda frames: frames[-2:][0], "frame 2 after an exposure was set is the first with it"),
        (lambda frames: frames[0], "one and the same frame, byte for byte"),
        (lambda frames: frames[-1] // 16, "its counts end at 255, below its white of 4095"),
        (lambda frames: frames[-1] & 0xFFF0, "its counts end at 4080 (all are multiples of 16), below"),
        (lambda frames: frames[-1].T[None], "gave uint16 of (1, 201, 201)"),
        (lambda frames: np.round(4095 * (frames[-1] / 4095) ** 0.5).astype(np.uint16), "is there gamma"),
        (lambda frames: 64 + frames[-1] % 5, "too little light at its longest exposure"),
    ],
)
def test_a_fault_of_a_camera_alone_is_named(devices, monkeypatch, fault, line):
    grab, frames = table.grab, []

    def spoilt(seconds: float, bits: int) -> np.ndarray:
        frames.append(grab(seconds, bits))
        return fault(frames)

    monkeypatch.setattr(table, "grab", spoilt)
    text, well = said(devices[:1])
    assert line in text
    assert not well


def test_a_camera_that_holds_the_last_picture_back_is_found_out_with_a_panel(devices, monkeypatch):
    write, shown = table.write, [np.zeros(table.PANEL, np.uint8)]

    def late(levels):
        shown.append(levels)

    def grab(seconds, bits, original=table.grab):
        frame = original(seconds, bits)
        write(shown[-1])
        return frame

    monkeypatch.setattr(table, "write", late)
    monkeypatch.setattr(table, "grab", grab)
    text, well = said(devices)
    assert not well
    assert text.endswith("let the panel settle for longer")
    assert "frame 2 after 1.5 s to settle is the first of a hologram" in text


def test_the_command_takes_files_and_a_bench_file_and_fails_with_a_fault(devices, tmp_path, monkeypatch):
    assert "no old frames" in run("doctor", devices[0])[0]
    (tmp_path / "bench.yaml").write_text(
        "name: b\nversion: 1\npanel: {shape: [128, 128], pitch: 6.4e-6, wavelengths: [5.17e-7], distance: 0.0118, "
        "bits: 8, pupil: 0.8, region: 0.8}\ncamera: {driver: my_camera.py:MyCamera, bits: 10}\n"
    )
    assert "counts: up to 1023 of 1023, 10 bits" in run("doctor", tmp_path / "bench.yaml")[0]
    (tmp_path / "lamp.py").write_text("class Lamp:\n    pass\n")
    for name, line in (
        (f"{tmp_path}/lamp.py:Lamp", "is no class with show(levels), as a panel, or expose(seconds), as a camera"),
        (f"{tmp_path}/lamp.py:Lmp", "did you mean 'Lamp'"),
        ("no.yaml", "no such file"),
    ):
        assert line in run("doctor", name)[1]
    monkeypatch.setattr(table, "grab", lambda seconds, bits: None)
    with pytest.raises(AssertionError, match="fault: simulated camera gave object of"):
        run("doctor", devices[0])  # an exit code of 1
