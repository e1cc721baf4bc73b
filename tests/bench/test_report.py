"""reports/performance: what is written can be read back, and the report follows from it alone."""

import json
import re

import numpy as np
import pytest
from PIL import Image

from holobench_eval.benchmarks import report
from holobench_eval.benchmarks.report import Timing
from holobench_eval.core.errors import UserError

MACHINE = {
    "revision": "abc",
    "dirty": False,
    "date": "2020-01-01T00:00:00+00:00",
    "cpu": "one",
    "platform": "Linux",
    "python": "3.11",
    "packages": {"torch": "2"},
    "threads": 2,
    "bandwidth": 1e10,
}
STEP = "gradient step, 1080x1920, 20 mm"
TIMINGS = [
    Timing(STEP, "four bare transforms", 0.04, 0.039, 0.041, 15, 1344, 2156, None, 1e8, 0, 0.05, 1e8, 0),
    Timing(STEP, "holobench_eval", 0.06, 0.059, 0.062, 15, 1344, 2156, 0.009, 2e8, 0, 0.06, 2e8, 0),
    Timing(STEP, "autograd, twice padded", 0.15, 0.14, 0.16, 9, 2160, 3840, 0.01, 5e8, 0, 0.3, 4e8, 81000),
    Timing("propagation, 256x256, 7 mm", "two bare transforms", 1e-3, 1e-3, 1e-3, 15, 300, 300, faults=0),
    Timing("propagation, 256x256, 7 mm", "holobench_eval", 1.5e-3, 1e-3, 2e-3, 15, 300, 300, faults=0),
    Timing("metric, three channels", "psnr", 0.02, 0.02, 0.02, 15, faults=3),
]


def test_timings_survive_the_file():
    assert report.from_csv(report.to_csv(TIMINGS)) == TIMINGS


def test_ratios_are_over_this_package_and_bare_transforms():
    text = report.text(TIMINGS, MACHINE)
    assert "| autograd, twice padded | 150 | 140 to 160 | 2.50 | 300 | 5.00 | 2160x3840 | 1.0e-02 | 477 | 381 |" in text
    # 8 bytes, 4 passes, 300 x 300 samples, 10 GB/s
    assert "| propagation, 256x256, 7 mm | 300x300 | 1.5 | 1 to 2 | 1 | 1.50 | 0.288 |" in text


def test_the_headline_is_the_steady_ratio_and_losses_stand_beside_wins():
    text = report.text(TIMINGS, MACHINE)
    assert "| autograd, twice padded | 2.50 (5.00) |" in text
    assert "| four bare transforms | 0.67 (0.83) |" in text


def test_what_was_not_timed_and_the_load_are_told():
    loads = {"load_before": 0.1, "load_after": 1.9}
    absent = {"missing": {"jax": ["JAX, twice padded", "chromatix"]}, "faults": {"metric | psnr": "it broke"}}
    text = report.text(TIMINGS, MACHINE | loads | absent)
    assert "- Not timed, since jax is not installed: JAX, twice padded; chromatix\n" in text
    assert "- Not timed: metric \\| psnr: it broke" in text
    assert "; load before: 0.1; load after: 1.9." in text


def test_a_report_follows_from_its_timings(tmp_path):
    assert report.write(tmp_path, TIMINGS, MACHINE) == tmp_path / "report.md"
    assert np.ptp(Image.open(tmp_path / "ratios.png").convert("L")) > 200  # is drawn
    assert report.problems(tmp_path) == []
    changed = (tmp_path / "timings.csv").read_text().replace("0.06", "0.05")
    (tmp_path / "timings.csv").write_text(changed)
    assert "does not follow" in report.problems(tmp_path)[0]


def test_without_others_there_is_no_chart_nor_an_earlier_one(tmp_path):
    report.write(tmp_path, TIMINGS, MACHINE)
    report.write(tmp_path, TIMINGS[-1:], MACHINE)
    assert not (tmp_path / "ratios.png").exists()
    assert "ratios.png" not in (tmp_path / "report.md").read_text()


def test_damaged_files_are_a_problem_and_not_a_traceback(tmp_path):
    report.write(tmp_path, TIMINGS, MACHINE)
    (tmp_path / "machine.json").write_text(json.dumps([]))
    assert report.problems(tmp_path)
    (tmp_path / "timings.csv").write_text("a,b\n")
    assert "should have the columns" in report.problems(tmp_path)[0]
    with pytest.raises(UserError, match="columns"):
        report.from_csv("a,b\n")


@pytest.mark.parametrize("bandwidth", [0, -1, float("nan"), float("inf"), 10**400])
def test_a_bandwidth_that_nothing_has_is_a_problem(tmp_path, bandwidth):
    report.write(tmp_path, TIMINGS, MACHINE)
    (tmp_path / "machine.json").write_text(json.dumps(MACHINE | {"bandwidth": bandwidth}))
    assert report.problems(tmp_path)[0].startswith("machine.json: bandwidth: Input should be ")


@pytest.mark.parametrize(
    ("right", "wrong", "told"),
    [
        ("0.06,0.059", "0,0.059", "line 3: median_s: .* greater than 0"),
        ("0.06,0.059", "nan,0.059", "line 3: median_s: .* less than"),
        ("0.06,0.059", "inf,0.059", "line 3: median_s: .* less than"),
        ("0.0015,0.001,0.002,15,300,300", "0.0015,0.001,0.002,0,300,300", "line 6: rounds: .* greater than 0"),
        ("0.0015,0.001,0.002,15,300,300", "0.0015,0.001,0.002,15,,", "rows and columns are missing"),
        ("0.0015,0.001,0.002,15,300,300", f"0.0015,0.001,0.002,15,300,1{400 * '0'}", "line 6: columns: .* less than"),
        ("psnr", 200_000 * "x", "field larger than field limit"),
    ],
)
def test_timings_that_nothing_takes_are_a_problem(tmp_path, right, wrong, told):
    report.write(tmp_path, TIMINGS, MACHINE)
    content = (tmp_path / "timings.csv").read_text()
    assert right in content
    (tmp_path / "timings.csv").write_text(content.replace(right, wrong))
    assert re.search(told, report.problems(tmp_path)[0])


def test_deeply_nested_json_is_a_problem(tmp_path):
    report.write(tmp_path, TIMINGS, MACHINE)
    (tmp_path / "machine.json").write_text(100_000 * "[")
    assert "RecursionError" in report.problems(tmp_path)[0]
