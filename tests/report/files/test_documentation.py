"""The lines of pandas in docs/results/data.md answer what they say they do."""

from __future__ import annotations

import re
from pathlib import Path

import pandas as pd
import pytest

from holobench_eval.report import Results, layout_of, read_records
from holobench_eval.report.files import write_files
from holobench_eval.study.config import load_study

ROOT = Path(__file__).parents[3]
EXAMPLES = re.findall(
    r"<!-- pandas -->\n```python\n(.*?)```", (ROOT / "docs" / "results" / "data.md").read_text(), re.DOTALL
)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The files of the leaderboard, written from its committed records, in the working folder."""
    report = tmp_path / "reports" / "leaderboard"
    report.mkdir(parents=True)
    records = read_records((ROOT / "reports" / "leaderboard" / "records.csv").read_text())
    write_files(Results(records, layout_of(load_study(ROOT / "configs" / "leaderboard.yaml"))), report)
    monkeypatch.chdir(tmp_path)
    return report


def test_the_examples_print_the_differences_of_each_display_and_every_test_of_a_method(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    printed = []
    for example in EXAMPLES:
        assert len([line for line in example.splitlines() if line and not line.startswith("import")]) <= 3
        exec(example, {})
        printed.append(capsys.readouterr().out)
    differences, every = printed
    tests = pd.read_csv(folder / "tests.csv").query("label == 'hil'").set_index("condition")
    assert len(tests) > 1
    for condition, difference in tests["difference_db"].items():
        (value,) = re.findall(rf"^{condition}\s+(\S+)$", differences, re.MULTILINE)
        assert float(value) == pytest.approx(difference, abs=2e-5)
    assert [line.split()[1] for line in every.splitlines() if re.match(r"\d", line)] == tests.index.tolist()
