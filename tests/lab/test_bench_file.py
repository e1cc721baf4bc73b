"""What a bench that exists cannot be is refused at its line."""

from pathlib import Path

import pytest

from holobench_eval.core.errors import UserError
from holobench_eval.lab.bench_file import load_bench_file

BENCH = """name: ours
version: 1
panel:
  shape: [1080, 1920]
  pitch: 6.4e-6
  wavelengths: [5.17e-7]
  distance: 0.1
  bits: 8
"""


def test_a_panel_of_equal_steps_or_with_a_table_is_read(tmp_path: Path) -> None:
    (tmp_path / "bench.yaml").write_text(BENCH)
    assert load_bench_file(tmp_path / "bench.yaml").panel.spec("ours").levels == ()
    (tmp_path / "bench.yaml").write_text(f"{BENCH}  levels: {[100 * (level / 255) ** 2 for level in range(256)]}\n")
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
    (tmp_path / "bench.yaml").write_text(BENCH.replace(old, new))
    with pytest.raises(UserError, match=message):
        load_bench_file(tmp_path / "bench.yaml")
