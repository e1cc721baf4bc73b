"""Counts without light, and a bench file: what does not fit or cannot be is one line."""

from pathlib import Path

import numpy as np
import pytest
import tifffile
from PIL import Image

from holobench_eval.core.errors import UserError
from holobench_eval.lab.bench_file import load_bench_file
from holobench_eval.lab.dark import Dark, given_dark

COUNTS = np.random.default_rng(0).integers(0, 400, (1, 24, 32)).astype(np.uint16)
BENCH = """name: b
version: 1
panel: {shape: [128, 128], pitch: 8.0e-6, wavelengths: [5.2e-7], distance: 0.1, bits: 8}
capture: {dark_frames: 0, dark: DARK}
"""


def test_a_sample_below_the_dark_level_is_negative_and_does_not_wrap() -> None:
    for dark in (Dark(np.array(256.0)), given_dark("256")[0], Dark(np.full_like(COUNTS, 256))):
        light = dark.off(COUNTS)
        assert light.dtype.kind == "f"
        assert np.array_equal(light, COUNTS.astype(float) - 256)


@pytest.mark.parametrize("ending", [".tif", ".npy"])
@pytest.mark.parametrize("kind", [np.uint16, np.float32])
def test_a_dark_frame_or_the_mean_of_several_is_taken_off_sample_by_sample(tmp_path: Path, ending, kind) -> None:
    frame = (COUNTS[0] // 4).astype(kind) + np.array(0.5 if kind is np.float32 else 0, kind)
    path = tmp_path / f"dark{ending}"
    np.save(path, frame) if ending == ".npy" else tifffile.imwrite(path, frame, photometric="minisblack")
    dark, _ = given_dark(str(path))
    assert np.array_equal(dark.off(COUNTS)[0], COUNTS[0] - frame.astype(float))
    assert np.array_equal(dark.plane(2).off(COUNTS[0]), COUNTS[0] - frame.astype(float))


def test_dark_counts_that_do_not_fit_are_refused_in_one_line(tmp_path: Path) -> None:
    np.save(tmp_path / "small.npy", COUNTS[:, 1:])
    np.save(tmp_path / "eight.npy", np.zeros_like(COUNTS, np.uint8))
    np.save(tmp_path / "parts.npy", np.full(COUNTS.shape, 0.08, np.float32))
    np.save(tmp_path / "negative.npy", np.full(COUNTS.shape, -60.0))
    Image.fromarray(np.full((24, 32), 60, np.uint8)).save(tmp_path / "lossy.jpg", quality=98)
    for given, line in (
        (tmp_path / "small.npy", "1 x 23 x 32 samples and the photograph 1 x 24 x 32"),
        (tmp_path / "eight.npy", "8 bits and the photograph 16"),
        (tmp_path / "parts.npy", "the dark frame never exceeds 1 and the photograph counts to 65535"),
        (tmp_path / "negative.npy", "negative.npy: -60 on average; expected counts without light, 0 or more"),
        ("0.004", "the dark level is below 1 and the photograph counts to 65535; expected its counts"),
        (tmp_path / "lossy.jpg", "lossy.jpg: compressed with loss"),
        (tmp_path / "none.npy", "no such file; expected counts without light"),
        ("-3", "0 or more, or a file"),
        ("nan", "0 or more, or a file"),
    ):
        with pytest.raises(UserError, match=line) as caught:
            given_dark(str(given))[0].off(COUNTS)
        assert "\n" not in str(caught.value)


def test_a_part_of_a_count_is_dark_enough_for_8_bits_and_noise_around_zero_for_any(tmp_path: Path) -> None:
    counts = COUNTS.astype(np.uint8)
    assert np.array_equal(given_dark("0.5")[0].off(counts), counts - 0.5)
    noise = np.random.default_rng(1).normal(-0.1, 2, COUNTS.shape)
    np.save(tmp_path / "noise.npy", noise)
    assert np.allclose(given_dark(str(tmp_path / "noise.npy"))[0].off(COUNTS), COUNTS - noise)


def test_a_bench_file_names_a_level_or_a_file_beside_it_and_another_file_is_another_bench(tmp_path: Path) -> None:
    path = tmp_path / "bench.yaml"
    path.write_text(BENCH.replace("dark_frames: 0, dark: DARK", "dark: 8"))  # which counted frames once
    with pytest.raises(UserError, match="either dark frames"):
        load_bench_file(path)
    path.write_text(BENCH.replace("DARK", "64"))
    assert load_bench_file(path).capture.dark == 64
    path.write_text(BENCH.replace("DARK", "dark.npy"))
    digests = set()
    for level in (1, 2):
        np.save(tmp_path / "dark.npy", np.full((4, 4), level, np.uint16))
        bench = load_bench_file(path)
        assert given_dark(str(bench.capture.dark))[0].bias.max() == level
        digests.add(bench.digest)
    assert len(digests) == 2


OURS = """name: ours
version: 1
panel:
  shape: [1080, 1920]
  pitch: 6.4e-6
  wavelengths: [5.17e-7]
  distance: 0.1
  bits: 8
"""


def test_a_panel_of_equal_steps_or_with_a_table_is_read(tmp_path: Path) -> None:
    (tmp_path / "bench.yaml").write_text(OURS)
    assert load_bench_file(tmp_path / "bench.yaml").panel.spec("ours").levels == ()
    (tmp_path / "bench.yaml").write_text(f"{OURS}  levels: {[100 * (level / 255) ** 2 for level in range(256)]}\n")
    ((first, *_, last),) = load_bench_file(tmp_path / "bench.yaml").panel.spec("ours").levels
    assert (first, last) == (0.0, pytest.approx(2 * 3.14159265 * 255 / 256))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("1080, 1920", "32, 1920", ":4:10: a panel has at least 64 pixels a side"),
        ("bits: 8", "bits: 4", ":8:9: levels are written with 8 bits, got 4"),
        ("bits: 8", "bits: 8\n  levels: [0, 100]", ":9:11: the table has 2 entries; a panel of 8 bits has 256"),
        ("bits: 8", "bits: 8\n  blaze: [0.7, 50.3]", ":9:10: no panel shows more than 0.5 cycles a pixel"),
        ("bits: 8", "bits: 8\ncapture: {exposure: -1}", ":9:21: capture.exposure should be auto, or above 0"),
        ("bits: 8", "bits: 8\ncapture: {settle: -1}", r"bench.yaml:9:19: capture.settle should be auto, or 0 to"),
        ("bits: 8", "bits: 8\ncapture: {dark: 64}", r"bench.yaml:9:17: capture: either dark frames"),
        ("bits: 8", "bits: 8\n  linewidth: [1e-9, 1e-9]", ":9:14: there are 2 widths; the panel has 1 wavelengths"),
    ],
)
def test_another_panel_is_refused(tmp_path: Path, old: str, new: str, message: str) -> None:
    (tmp_path / "bench.yaml").write_text(OURS.replace(old, new))
    with pytest.raises(UserError, match=message):
        load_bench_file(tmp_path / "bench.yaml")
