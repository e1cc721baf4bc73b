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


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the files of Table 3, written from its committed records."""
    root = tmp_path_factory.mktemp("root")
    report = root / "reports" / "table3"
    report.mkdir(parents=True)
    records = read_records((ROOT / "reports" / "table3" / "records.csv").read_text())
    write_files(Results(records, layout_of(load_study(ROOT / "configs" / "table3.yaml"))), report)
    return root


def printed(example: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], folder: Path) -> str:
    monkeypatch.chdir(folder)
    exec(example, {})
    return capsys.readouterr().out


def test_every_example_is_three_lines_beside_the_import() -> None:
    assert len(EXAMPLES) == 2
    for example in EXAMPLES:
        assert len([line for line in example.splitlines() if line and not line.startswith("import")]) <= 3


def test_the_differences_of_the_first_example_are_those_of_the_tests_of_each_display(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    text = printed(EXAMPLES[0], monkeypatch, capsys, folder)
    tests = pd.read_csv(folder / "reports" / "table3" / "tests.csv").query("label == 'hil'").set_index("condition")
    assert len(tests) > 1
    for condition, difference in tests["difference_db"].items():
        (value,) = re.findall(rf"^{condition}\s+(\S+)$", text, re.MULTILINE)
        assert float(value) == pytest.approx(difference, abs=2e-5)


def test_the_second_example_prints_every_test_of_the_method(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    text = printed(EXAMPLES[1], monkeypatch, capsys, folder)
    tests = pd.read_csv(folder / "reports" / "table3" / "tests.csv").query("label == 'hil'")
    assert [line.split()[1] for line in text.splitlines() if re.match(r"\d", line)] == tests["condition"].tolist()
