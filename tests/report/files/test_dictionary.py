"""columns.md: every column that a report's files have."""

from __future__ import annotations

import re
from pathlib import Path

import pandas as pd

from holobench_eval.report import Description, write_report
from holobench_eval.report.files.dictionary import dictionary
from tests.support import budget_study as budget


def test_every_column_of_a_report_is_described_once_and_in_its_order(tmp_path: Path) -> None:
    _, results = write_report(budget.layout(), budget.study(), tmp_path, {}, Description())
    text = (tmp_path / "columns.md").read_text()
    assert "Not described" not in text
    for file in ("records.csv", "table.csv", "tests.csv"):
        (section,) = re.findall(rf"## {file}\n\n(.*?)(?:\n\n|\Z)", text, re.DOTALL)
        described = re.findall(r"^\| `(.+?)` \|", section, re.MULTILINE)
        assert ",".join(described) == (tmp_path / file).read_text().splitlines()[0]
    assert "| `solving_s` | Time to solve the target, of the solving that made the phase, in this run" in text
    assert results.headline.key in text


def test_the_name_of_a_published_metric_stays_text() -> None:
    name = "reported_<script>|[x](y)"
    text = dictionary({"table.csv": pd.DataFrame({name: [1.0]})})
    assert "| `reported_<script>\\|[x](y)` | Published figure of the metric" in text
    assert text.count("script") == 1


def test_a_column_without_an_entry_says_so_and_stays_text() -> None:
    frame = pd.DataFrame({"glare|<b>": [1.0]})
    assert "| `glare\\|<b>` | Not described |  | number |" in dictionary({"records.csv": frame})
