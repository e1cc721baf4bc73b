from __future__ import annotations

from pathlib import Path

import pytest

from holobench_eval.core.errors import UserError
from holobench_eval.report.compare.paired import provenance_differences, read_run
from tests.support.records_on_disk import write_report

SCORES = {("toy", "bench"): [20.0, 21.0, 22.0]}


def test_only_facts_that_differ_are_listed(tmp_path: Path) -> None:
    facts = {"revision": "aaa", "cpu": "one", "packages": {"torch": "2"}, "started": "monday"}
    profiles = [{"bench": {"version": 1, "sha256": digest * 64}} for digest in "01"]
    a = read_run(write_report(tmp_path / "a", SCORES, {**facts, "profiles": profiles[0]}))
    known = {**facts, "revision": "bbb", "started": "tuesday", "harness": "4", "profiles": profiles[1]}
    b = read_run(write_report(tmp_path / "b", SCORES, known))
    assert provenance_differences(a, b) == [
        ("revision", "aaa", "bbb"),
        ("display bench", f"version 1, sha256 {'0' * 12}", f"version 1, sha256 {'1' * 12}"),
        ("harness", "not recorded", "4"),
    ]


def test_a_folder_without_records_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"no records\.csv in this folder; expected the folder of a report"):
        read_run(tmp_path)


def test_a_cell_that_is_there_twice_is_named(tmp_path: Path) -> None:
    path = write_report(tmp_path, SCORES) / "records.csv"
    path.write_text(path.read_text() + path.read_text().splitlines()[1] + "\n")
    with pytest.raises(UserError, match=r"two rows for one cell \(toy, bench, t0\)"):
        read_run(tmp_path)


@pytest.mark.parametrize("text", ["", "a,b\n1,2\n", "\0"])
def test_a_file_that_is_no_table_of_records_is_one_line(tmp_path: Path, text: str) -> None:
    (tmp_path / "records.csv").write_text(text)
    with pytest.raises(UserError) as error:
        read_run(tmp_path)
    assert str(error.value).startswith(str(tmp_path))
    assert "\n" not in str(error.value)
