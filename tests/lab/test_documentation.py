"""The bench file of docs/real-bench.md is one that works."""

import re
from pathlib import Path

import pytest

from holobench_eval.lab.bench_file import CaptureSettings, load_bench_file
from holobench_eval.lab.drivers.catalogue import checked_params
from holobench_eval.lab.laser import SwitchedLaser, laser

PAGE = Path(__file__).parents[2] / "docs" / "real-bench.md"


def test_the_documented_bench_file_is_read_and_its_settings_are_those_that_exist(tmp_path):
    blocks = re.findall(r"```yaml\n(.*?)```", PAGE.read_text(encoding="utf-8"), flags=re.DOTALL)
    path = tmp_path / "my-bench.yaml"
    path.write_text(next(block for block in blocks if block.startswith("# my-bench.yaml")), encoding="utf-8")
    bench = load_bench_file(path)
    for kind, section in (("slm", bench.slm), ("camera", bench.camera)):
        params = dict(section)
        checked_params(kind, params.pop("driver"), params)
    assert bench.capture == CaptureSettings()  # the page shows the defaults
    assert isinstance(laser(bench.laser, 3, tmp_path, pytest.fail), SwitchedLaser)
    assert "{channel}" in bench.laser.command
