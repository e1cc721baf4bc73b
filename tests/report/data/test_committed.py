"""A report from its committed files alone is the report that its records gave."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from holobench_eval.report import build_report, committed_records, difference, read_records
from holobench_eval.study.config import load_study
from holobench_eval.study.plan import plan
from tests.study.studies import compute
from tests.support.reports import files
from tests.support.studies.fake_study import write_config

pytestmark = pytest.mark.usefixtures("no_physics")


def test_a_report_from_records_csv_has_the_same_bytes_and_keeps_its_pictures(tmp_path: Path) -> None:
    methods = ("plugins.py:Toy", '{name: "plugins.py:Toy", label: "fails | a bit", params: {fail: "no <light>"}}')
    config, output = write_config(tmp_path, methods), tmp_path / "out"
    outcome, study = compute(config, output), load_study(config)
    build_report(study, outcome.records, output, outcome.provenance)
    shutil.rmtree(output / "records")
    before = files(output)
    assert "figures/answer-pictures.jpg" in before

    frame = read_records((output / "records.csv").read_text())
    assert difference(frame, plan(study)) == ""
    records = committed_records(frame, plan(study))
    for path in output.glob("figures/*.png"):
        path.unlink()
    build_report(study, records, output, outcome.provenance, keep_pictures=True)
    after = files(output)
    assert after.keys() == before.keys()
    assert after["details.md"].decode() == before["details.md"].decode()
    changed = [name for name in before if before[name] != after[name]]
    assert changed == ["report.html"]  # which held the pictures of the records


def test_other_cells_than_those_that_are_planned_are_counted(tmp_path: Path) -> None:
    config = write_config(tmp_path, count=2)
    outcome = compute(config, tmp_path / "out")
    study = load_study(config)
    build_report(study, outcome.records, tmp_path / "out", outcome.provenance)
    frame = read_records((tmp_path / "out" / "records.csv").read_text())
    config.write_text(config.read_text().replace("count: 2", "count: 1"))
    assert difference(frame, plan(load_study(config))) == (
        "6 of 6 planned cells are not in records.csv, 14 of 14 cells in records.csv are not planned"
    )
