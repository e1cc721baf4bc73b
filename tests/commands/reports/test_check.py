from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
import typer

from holobench_eval.commands.reports.check import check, problems_in
from holobench_eval.core.errors import UserError
from holobench_eval.report import build_report
from holobench_eval.study.config import load_study
from tests.study.test_run import compute
from tests.support.fake_study import write_config

pytestmark = pytest.mark.usefixtures("no_physics")


@pytest.fixture
def report(tmp_path: Path) -> Path:
    """A folder with one finished study in ``reports/`` and its config beside."""
    config = write_config(tmp_path, count=2)
    folder = tmp_path / "reports" / "study"
    outcome = compute(config, folder)
    build_report(load_study(config), outcome.records, folder, outcome.provenance)
    return folder


def problems(report: Path) -> list[str]:
    reports, found = problems_in(report.parent)
    assert reports == 1
    return found


def test_a_report_that_follows_from_its_records_passes(report: Path) -> None:
    assert problems(report) == []


def test_a_report_itself_is_checked_as_one_in_its_folder(report: Path) -> None:
    assert problems_in(report) == problems_in(report.parent) == (1, [])


def test_a_changed_number_in_a_table_is_found(report: Path) -> None:
    table = report / "table.csv"
    table.write_text(re.sub("(Toy,open loop,.*?,,,,)2,", r"\g<1>3,", table.read_text()))
    assert ["does not follow from records.csv" in problem for problem in problems(report)] == [True]


@pytest.mark.parametrize("name", ["tests.csv", "table.tex", "columns.md"])
def test_an_edited_or_missing_file_of_data_is_found(report: Path, name: str) -> None:
    file = report / name
    file.write_text(f"{file.read_text()}1.0\n")
    (problem,) = problems(report)
    assert problem.startswith(f"{report}: {name} does not follow from records.csv; run: holoeval report ")
    assert problem.endswith(f"study.yaml --output {report}")
    file.unlink()
    assert [f"{name} is missing" in problem for problem in problems(report)] == [True]


def test_a_table_of_another_version_is_told_from_a_changed_number(report: Path) -> None:
    table = report / "table.csv"
    table.write_text(table.read_text().replace("psnr_linear_median", "psnr_linear_mode"))
    assert ["columns of another version" in problem for problem in problems(report)] == [True]


def test_a_config_that_plans_other_cells_is_found(report: Path) -> None:
    config = report.parents[1] / "study.yaml"
    config.write_text(config.read_text().replace("seed: 3", "seed: 4"))
    (problem,) = problems(report)
    assert "14 of 14 planned cells are not in records.csv" in problem
    assert "run the study again" in problem


def test_a_comment_or_a_question_in_a_config_asks_for_a_report_and_not_for_a_run(report: Path) -> None:
    config = report.parents[1] / "study.yaml"
    config.write_text(f"{config.read_text()}question: Why?  # later\n")
    (problem,) = problems(report)
    assert "has changed, but no cell; run: holoeval report " in problem


@pytest.mark.parametrize("name", ["report.md", "details.md"])
def test_a_missing_text_is_found(report: Path, name: str) -> None:
    (report / name).unlink()
    assert [f"{name} is missing" in problem for problem in problems(report)] == [True]


def test_a_config_that_does_not_load_is_found(report: Path) -> None:
    config = report.parents[1] / "study.yaml"
    config.write_text(config.read_text() + "sede: 1\n")
    assert ["unknown key 'sede'" in problem for problem in problems(report)] == [True]


def test_a_changed_profile_is_found(report: Path) -> None:
    file = report / "provenance.json"
    file.write_text(file.read_text().replace('"version": 1', '"version": 77'))
    assert ["profile 'ideal' was {'version': 77" in problem for problem in problems(report)] == [True]


@pytest.mark.parametrize("name", ["table.csv", "records.csv"])
def test_a_missing_table_is_found(report: Path, name: str) -> None:
    (report / name).unlink()
    assert [name in problem for problem in problems(report)] == [True]


def test_a_damaged_provenance_is_found(report: Path) -> None:
    (report / "provenance.json").write_text("{}")
    assert ["lacks config, config_sha256, profiles" in problem for problem in problems(report)] == [True]


def test_a_folder_without_reports_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="no report, and none in its folders"):
        problems_in(tmp_path)


def test_scores_by_an_earlier_protocol_are_no_problem_and_said_in_one_line(
    report: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = report / "provenance.json"
    known = json.loads(file.read_text())
    known["scores"] = {name: version.replace("v2", "v1") for name, version in known["scores"].items()}
    file.write_text(json.dumps(known))
    check(report.parent)
    assert capsys.readouterr().out.splitlines() == [
        "1 report of scores by metric protocol v1, as their pages say; now it is v2, by which the next 'holoeval run' "
        "of their studies scores",
        "1 report, 0 problems",
    ]


@pytest.mark.parametrize("text", ["{", '{"scores": 3}', '{"scores": {"psnr": 1}}'])
def test_a_provenance_that_is_no_provenance_ends_the_check_with_its_problem_alone(
    report: Path, text: str, capsys: pytest.CaptureFixture[str]
) -> None:
    (report / "provenance.json").write_text(text)
    with pytest.raises(typer.Exit):
        check(report.parent)
    assert "1 report, 1 problem" in capsys.readouterr().out
