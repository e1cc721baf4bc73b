from __future__ import annotations

import csv as reader
import io
from pathlib import Path

import pytest

from holobench_eval.report.compare.page import csv, markdown
from holobench_eval.report.compare.paired import Comparison, compare, read_run
from tests.support.records_on_disk import write_report

A, B = [20.0, 21.0, 22.0], [20.5, 21.4, 22.6]
HOSTILE = ("<script>alert(1)</script>", "a | b", "=cmd()", "[x](http://example.org)", "*bold*")


def of_methods(folder: Path, *names: str) -> Comparison:
    runs = (
        read_run(write_report(folder / run, {(name, "bench"): values for name in names}, {"revision": run}))
        for run, values in (("a", A), ("b", B))
    )
    return compare(*runs)


def test_markdown_and_csv_have_the_same_numbers_and_the_page_says_what_differs_besides(tmp_path: Path) -> None:
    comparison = of_methods(tmp_path, "toy")
    text, row = markdown(comparison), next(reader.DictReader(io.StringIO(csv(comparison))))
    mean, low, high = (float(row[f"difference{end}"]) for end in ("", "_low", "_high"))
    assert f"{mean:+.3f} [{low:+.3f}, {high:+.3f}]" in text
    assert (row["unit"], row["targets"], row["verdict"]) == ("dB", "3", "better")
    assert float(row["mean_b"]) - float(row["mean_a"]) == pytest.approx(mean, abs=1e-3)
    assert "| revision | a | b |" in text
    assert "| t2 | toy | bench | 22.00 | 22.60 | +0.600 |" in text


@pytest.mark.parametrize("name", HOSTILE)
def test_a_hostile_name_stays_text(tmp_path: Path, name: str) -> None:
    comparison = of_methods(tmp_path, name)
    text = markdown(comparison)
    assert "<script>" not in text
    assert "[x](http" not in text
    assert "*bold*" not in text.replace("\\*", "")
    table = text[text.index("| method") :].split("\n\n")[0].splitlines()
    assert {line.replace("\\|", "").count("|") for line in table} == {8}
    cell = next(reader.DictReader(io.StringIO(csv(comparison))))["method"]
    assert cell.lstrip("'") == name
    assert not cell.startswith("=")


@pytest.mark.parametrize("protocols", [("v1", "v2"), ("v2", "v2")])
def test_scores_of_two_protocols_are_never_compared_without_a_word(tmp_path: Path, protocols: tuple[str, str]) -> None:
    runs = []
    for run, protocol in zip("ab", protocols, strict=True):
        folder = write_report(tmp_path / run, {("toy", "bench"): A})
        records = (folder / "records.csv").read_text().splitlines()
        lines = [records[0], *(f"{line.rpartition(',')[0]},{protocol}" for line in records[1:])]
        (folder / "records.csv").write_text("\n".join(lines) + "\n")
        runs.append(read_run(folder))
    text = markdown(compare(*runs))
    assert ("A is scored by metric protocol v1 and B by v2." in text) == (protocols[0] != protocols[1])
