from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from holobench_eval.report import Description, write_report
from holobench_eval.report.charts.error_budget import draw_budgets
from holobench_eval.report.data.error_budget import budgets
from holobench_eval.report.sections.display.error_budget import reading
from tests.report.data.test_error_budget import LEFT, METHODS, record, results
from tests.support.reports import whole


def test_the_paragraph_bounds_what_each_prediction_and_the_noise_allow() -> None:
    (budget,) = budgets(results())
    text = str(reading(budget, "wirtinger"))
    assert text.startswith("**ideal.** The captures of wirtinger holograms have 19.00")
    network, field = budget.explained[-2:]
    assert network.gain is not None
    assert field.gain is not None
    assert f"network {network.gain.mean:.2f}" in text
    assert f"and field {field.gain.mean:.2f}" in text
    assert "Temporal noise allows no more than" in text
    assert "nan" not in text


def test_a_display_without_noise_sets_no_limit() -> None:
    (budget,) = budgets(results())
    quiet = replace(budget, noise=replace(budget.noise, gain=None))
    assert "There is no temporal noise." in str(reading(quiet, "wirtinger"))


def test_noise_of_some_targets_is_said_to_be_theirs() -> None:
    (budget,) = budgets(results())
    assert "that have any" not in str(reading(budget, "wirtinger"))
    assert budget.noise.gain is not None
    some = replace(budget, noise=replace(budget.noise, gain=replace(budget.noise.gain, n=2)))
    assert "over the 2 of 3 targets that have any." in str(reading(some, "wirtinger"))


def test_a_report_has_the_figure_of_the_budget_on_its_first_page_and_its_tables_in_the_details(tmp_path: Path) -> None:
    records = [record(label, target) for target in LEFT for label in METHODS]
    text = whole(write_report(results().layout, records, tmp_path, {}, Description())[0])
    assert text.index("## Answer") < text.index("(figures/error-budget.png)") < text.index("## What was measured")
    assert text.index("# Details: ") < text.index("## The error budget")
    assert (tmp_path / "figures" / "error-budget.png").is_file()
    assert "| temporal noise |" in text


def test_nothing_is_drawn_without_a_budget(tmp_path: Path) -> None:
    draw_budgets(tmp_path / "none.png", [])
    assert not (tmp_path / "none.png").exists()
