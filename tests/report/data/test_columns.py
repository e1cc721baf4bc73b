"""Names and meanings of the columns of a report's files, and what a column more takes."""

import csv
import math
import re
from pathlib import Path

import pandas as pd
import pytest

from holobench_eval.metrics.catalogue import catalogue
from holobench_eval.report import Description, Layout, write_report
from holobench_eval.report.data import columns
from holobench_eval.report.data.column import Cells, Column, Record, column, if_known, mean
from holobench_eval.report.data.scores import parse
from holobench_eval.report.data.tables import read_records, records_frame
from holobench_eval.report.files.dictionary import File, dictionary
from holobench_eval.report.files.dictionary import column as described
from holobench_eval.report.page.data import page_data
from holobench_eval.report.section import Report
from tests.support import budget_study as budget

REPORTS = Path(__file__).parents[3] / "reports"


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


@pytest.mark.parametrize(
    ("cells", "photographs"),
    [
        ([("a", "done", 100), ("a", "done", 90), ("b", "done", 100)], 195),  # repeats of a target are averaged
        ([("a", "done", 100), ("b", "failed", 3)], 103),
        ([("a", "done", 100), ("a", "failed", 4)], 100),  # not their mean
        ([("a", "failed", 4)], 4),
        ([("a", "missing", None)], None),
    ],
)
def test_photographs_of_failed_cells_count(cells: list[tuple[str, str, int | None]], photographs: float | None) -> None:
    frame = pd.DataFrame(cells, columns=["target", "state", "captures"])
    (total_captures,) = (each for each in columns.FIGURES if each.name == "total_captures")
    assert total_captures.table is not None
    total = total_captures.table(Cells(frame, Layout("a study", (), ())), "total_captures")
    assert total == photographs or (photographs is None and math.isnan(total))


@pytest.mark.parametrize("file", ["records.csv", "table.csv", "tests.csv"])
def test_every_column_of_the_committed_reports_has_an_entry(file: File) -> None:
    reports = sorted(REPORTS.glob(f"**/{file}"))
    assert len(reports) > 10
    names = {name for path in reports for name in header(path)}
    assert len(names) > (10 if file == "tests.csv" else 50)
    assert [name for name in sorted(names) if described(file, name) is None] == []


@pytest.mark.parametrize("end", ["", "_lo", "_hi"])
def test_every_metric_of_the_catalogue_has_an_entry_with_its_unit(end: str) -> None:
    for metric in catalogue():
        for domain in metric.domains:
            found = described("table.csv", parse(f"{metric.name}_{domain}").statistic(end))
            assert found is not None
            assert (found.unit, found.kind) == (metric.unit, "number")
            assert not metric.unit or found.name.endswith(f"_{metric.unit.lower()}")


def test_an_entry_says_what_a_difference_is_of_and_a_column_that_the_dictionary_lacks_is_found_out() -> None:
    scores = ("glare", "psnr_linear_glare_db", "psnr_linear_lo_db")
    for file, name in (("tests.csv", "psnr_linear_db"), *(("records.csv", name) for name in scores)):
        assert described(file, name) is None
    found = described("tests.csv", "difference_lo_db")
    assert found is not None
    assert (found.unit, found.kind) == ("dB", "number")
    assert "not adjusted" in found.meaning


@pytest.fixture
def energy(monkeypatch: pytest.MonkeyPatch) -> None:
    """A figure of a run more: one entry."""
    figures: list[Column] = []
    told = "Energy of solving, mean over cells"

    @column(figures, "number", unit="J", kept=if_known, table=mean, table_meaning=told, heading="energy per {each} [J]")
    def energy_j(record: Record, layout: Layout) -> float | None:
        """Energy that solving took."""
        return record.get("energy")

    monkeypatch.setattr(columns, "FIGURES", [*columns.FIGURES, *figures])


@pytest.mark.usefixtures("energy")
def test_a_figure_of_a_run_takes_one_entry(tmp_path: Path) -> None:
    layout = budget.layout()
    records = [{**record, "energy": 2.5 + index} for index, record in enumerate(budget.study())]
    _, results = write_report(layout, records, tmp_path, {}, Description())
    cells, table = (pd.read_csv(tmp_path / name) for name in ("records.csv", "table.csv"))
    first = cells[(cells["label"] == "double_phase") & (cells["condition"] == "leto-aged")]
    assert first["energy_j"].tolist() == [2.5, 3.5, 4.5, 5.5, 6.5, 7.5]
    assert table.set_index(["label", "condition"]).loc[("double_phase", "leto-aged"), "energy_j"] == 5.0
    dictionary = (tmp_path / "columns.md").read_text()
    assert "| `energy_j` | Energy that solving took | J | number |" in dictionary
    assert "| `energy_j` | Energy of solving, mean over cells | J | number |" in dictionary
    page = page_data(Report(results, records, tmp_path, {}, Description()))
    assert {"key": "energy_j", "heading": "energy per hologram [J]", "higher": False} in page["columns"]
    row = next(row for row in page["rows"]["leto-aged"] if row["method"] == "double_phase")
    assert row["cells"]["energy_j"] == {"text": "5", "value": 5.0}
    pd.testing.assert_frame_equal(read_records((tmp_path / "records.csv").read_text()), results.frame)
    committed = [{"row": row} for row in results.frame.to_dict("records")]
    pd.testing.assert_frame_equal(records_frame(committed, budget.layout()), results.frame)
    without = budget.results()  # a figure that no record has is in no file
    assert "energy_j" not in {*without.frame, *without.table}


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


def test_the_name_of_a_published_metric_stays_text_and_a_column_without_an_entry_says_so() -> None:
    name = "reported_<script>|[x](y)"
    text = dictionary({"table.csv": pd.DataFrame({name: [1.0]})})
    assert "| `reported_<script>\\|[x](y)` | Published figure of the metric" in text
    assert text.count("script") == 1

    frame = pd.DataFrame({"glare|<b>": [1.0]})
    assert "| `glare\\|<b>` | Not described |  | number |" in dictionary({"records.csv": frame})
