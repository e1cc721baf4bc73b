from __future__ import annotations

from pathlib import Path

from holobench_eval.report import Description, write_report
from tests.report.data.test_error_budget import LEFT, METHODS, record, results


def test_a_report_has_the_figure_and_the_parts_of_the_budget_on_its_first_page(tmp_path: Path) -> None:
    records = [record(label, target) for target in LEFT for label in METHODS]
    text = write_report(results().layout, records, tmp_path, {}, Description())[0].read_text()
    assert text.index("## Answer") < text.index("| temporal noise |") < text.index("(figures/error-budget.png)")
    assert (tmp_path / "figures" / "error-budget.png").is_file()
