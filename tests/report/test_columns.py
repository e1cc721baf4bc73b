"""Names and meanings of the columns of a report's files, and what a column more takes."""

import csv
import re
from pathlib import Path

import pandas as pd
import pytest

from holobench_eval.metrics.catalogue import catalogue
from holobench_eval.report import Description, write_report
from holobench_eval.report.columns import described, dictionary
from holobench_eval.report.scores import parse
from tests.support import budget_study as budget

REPORTS = Path(__file__).parents[2] / "reports"


def header(path: Path) -> list[str]:
    with path.open(newline="") as file:
        return next(csv.reader(file))


def test_a_unit_is_the_last_part_of_a_column_and_the_key_comes_back() -> None:
    columns_of = {
        **{"psnr_linear": "psnr_linear_db", "psnr_linear_blur0.5": "psnr_linear_blur0.5px_db", "psnr": "psnr_db"},
        **{"psnr_srgb_refined": "psnr_srgb_refined_db", "refine_dx_px": "refine_dx_px"},
        **{"ssim_srgb": "ssim_srgb", "1-lpips": "1-lpips"},
    }
    for key, expected in columns_of.items():
        assert parse(key).column == expected
        assert parse(expected) == parse(key)
    assert parse("psnr_linear").statistic("_lo") == "psnr_linear_lo_db"
    assert parse("ssim_linear_blur1").statistic("_hi") == "ssim_linear_blur1px_hi"


@pytest.mark.parametrize("file", ["records.csv", "table.csv", "tests.csv"])
def test_every_column_of_the_committed_reports_has_an_entry(file: str) -> None:
    reports = sorted(REPORTS.glob(f"*/{file}"))
    assert len(reports) > 10
    names = {name for path in reports for name in header(path)}
    assert len(names) > (10 if file == "tests.csv" else 50)
    assert [name for name in sorted(names) if described(file, name)[0] == "Not described"] == []


@pytest.mark.parametrize("end", ["", "_lo", "_hi"])
def test_every_metric_of_the_catalogue_has_an_entry_with_its_unit(end: str) -> None:
    for metric in catalogue():
        for domain in metric.domains:
            name = parse(f"{metric.name}_{domain}").statistic(end)
            assert described("table.csv", name)[1:] == (metric.unit, "number")
            assert not metric.unit or name.endswith(f"_{metric.unit.lower()}")


def test_an_entry_says_what_a_difference_is_of_and_a_column_that_the_dictionary_lacks_is_found_out() -> None:
    scores = ("glare", "psnr_linear_glare_db", "psnr_linear_lo_db")
    for file, name in (("tests.csv", "psnr_linear_db"), *(("records.csv", name) for name in scores)):
        assert described(file, name)[0] == "Not described"
    meaning, *rest = described("tests.csv", "difference_lo_db")
    assert rest == ["dB", "number"]
    assert "not adjusted" in meaning


def test_every_column_of_a_report_is_described_once_and_in_its_order(tmp_path: Path) -> None:
    _, results = write_report(budget.facts(), budget.study(), tmp_path, {}, Description())
    text = (tmp_path / "columns.md").read_text()
    assert "Not described" not in text
    for file in ("records.csv", "table.csv", "tests.csv"):
        (section,) = re.findall(rf"## {file}\n\n(.*?)(?:\n\n|\Z)", text, re.DOTALL)
        described = re.findall(r"^\| `(.+?)` \|", section, re.MULTILINE)
        assert ",".join(described) == (tmp_path / file).read_text().splitlines()[0]
    assert "| `solving_s` | Time to solve the target, of the solving that made the phase, in this run" in text
    assert results.headline.key in text


def test_the_name_of_a_published_metric_stays_text_and_a_column_without_an_entry_says_so() -> None:
    name = "reported_<script>|[x](y)"
    text = dictionary({"table.csv": pd.DataFrame({name: [1.0]})})
    assert "| `reported_<script>\\|[x](y)` | Published figure of the metric" in text
    assert text.count("script") == 1

    frame = pd.DataFrame({"glare|<b>": [1.0]})
    assert "| `glare\\|<b>` | Not described |  | number |" in dictionary({"records.csv": frame})
