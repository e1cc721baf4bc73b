"""The command: what it writes, what it prints, and its exit codes."""

import pytest
from typer.testing import CliRunner

from holobench_eval.benchmarks import against, machine, measure
from holobench_eval.benchmarks.against import Comparison
from holobench_eval.benchmarks.measure import Measured
from holobench_eval.benchmarks.report import Timing
from holobench_eval.commands import app
from tests.bench.test_report import MACHINE

STEP, LOADS = "gradient step", ("load_before", "load_after")


@pytest.fixture
def measured(monkeypatch):
    def fix(faults=None):
        rows = [
            Timing(STEP, "holobench_eval", 0.1, 0.1, 0.1, 3, 10, 10, 0.01, 2.0**20, 0, 0.1, 2.0**20, 0),
            Timing(STEP, "another", 0.2, 0.2, 0.2, 3, 10, 10, 0.02, 2.0**20, 0, 0.3, 2.0**20, 9),
            Timing("metric", "psnr", 0.1, 0.1, 0.1, 3),
        ]
        monkeypatch.setattr(measure, "measure", lambda only, advance: Measured(rows, faults=faults or {}))
        monkeypatch.setattr(machine, "few_processors", lambda: None)
        monkeypatch.setattr(machine, "describe", lambda *loads: MACHINE | dict(zip(LOADS, loads, strict=True)))

    return fix


def test_the_report_is_written_and_holds_when_it_is_checked(measured, tmp_path):
    measured()
    done = CliRunner().invoke(app, ["bench", "--output", str(tmp_path / "performance")])
    assert done.exit_code == 0
    assert done.stdout.split()[-1] == str(tmp_path / "performance" / "report.md")
    rows = (tmp_path / "performance" / "timings.csv").read_text().splitlines()
    assert rows[2].endswith("1.04858e+06,0,0.3,1.04858e+06,9")
    assert rows[3].endswith(",3,,,,,,,,")
    checked = CliRunner().invoke(app, ["check", str(tmp_path)])
    assert "1 report, 0 problems" in checked.output
    (tmp_path / "performance" / "report.md").write_text("# Faster than light\n")
    checked = CliRunner().invoke(app, ["check", str(tmp_path)])
    assert checked.exit_code == 1
    assert "does not follow from timings.csv" in checked.output


def test_a_part_does_not_take_the_place_of_the_whole(measured, tmp_path, monkeypatch):
    measured()
    monkeypatch.chdir(tmp_path)
    for arguments, place in (([], "reports/performance"), (["--only", "psnr"], ".benchmarks/part")):
        done = CliRunner().invoke(app, ["bench", *arguments])
        assert done.stdout.split()[-1] == f"{place}/report.md"


def test_what_could_not_be_timed_is_told_by_the_exit_code(measured, tmp_path):
    measured(faults={"metric | ssim": "ValueError: too small"})
    done = CliRunner().invoke(app, ["bench", "--output", str(tmp_path)])
    assert done.exit_code == 1
    assert "could not be timed: metric | ssim: ValueError: too small" in done.output
    assert "- Not timed: metric" in (tmp_path / "report.md").read_text()


@pytest.mark.parametrize(
    ("load", "warned", "noted"),
    [(1.8, True, "load before: 1.8; load after: 1.8."), (0.5, False, "load before: 0.5; load"), (None, False, "")],
)
def test_a_busy_machine_is_told_of_and_noted(measured, monkeypatch, tmp_path, load, warned, noted):
    measured()
    monkeypatch.setattr(machine, "load", lambda: load)
    done = CliRunner().invoke(app, ["bench", "--output", str(tmp_path / "performance")])
    assert ("the machine is busy (load 1.8)" in done.stderr) == warned
    first = (tmp_path / "performance" / "report.md").read_text().split("\n\n")[1]
    assert noted in first
    assert ("load before" in first) == bool(noted)
    assert "1 report, 0 problems" in CliRunner().invoke(app, ["check", str(tmp_path)]).output


def test_the_load_is_unknown_where_the_system_does_not_tell(monkeypatch):
    assert machine.load() is None or machine.load() >= 0
    monkeypatch.delattr("os.getloadavg", raising=False)
    assert machine.load() is None


def test_the_run_keeps_to_as_many_processors_as_threads(monkeypatch):
    kept = []
    monkeypatch.setattr("os.sched_getaffinity", lambda process: {3, 1, 5}, raising=False)
    monkeypatch.setattr("os.sched_setaffinity", lambda process, which: kept.append(which), raising=False)
    machine.few_processors()
    assert kept == [[1, 3]]


@pytest.mark.parametrize(("verdict", "code"), [("slower", 1), ("unchanged", 0), ("faster", 0)])
def test_a_slower_case_is_exit_code_1(monkeypatch, verdict, code):
    monkeypatch.setattr(machine, "few_processors", lambda: None)
    monkeypatch.setattr(
        against, "against", lambda revision, cases, advance: [Comparison(cases[0], verdict, 1.2, 1.1, 1.3)]
    )
    done = CliRunner().invoke(app, ["bench", "--against", "HEAD"])
    assert done.exit_code == code
    assert verdict in done.output
    assert "1.100 to 1.300" in done.output


def test_revisions_cases_and_reasons_are_shown_as_they_are(monkeypatch):
    def compare(revision, cases, advance):
        advance("a case [/]", 0, 1)
        return [Comparison("a case [/]", "not in both", reason="KeyError: [/red]")]

    monkeypatch.setattr(machine, "few_processors", lambda: None)
    monkeypatch.setattr(against, "against", compare)
    done = CliRunner().invoke(app, ["bench", "--against", "HEAD^{/[/]}"])
    assert done.exit_code == 0
    assert all(text in done.output for text in ("HEAD^{/[/]}", "a case [/]", "KeyError: [/red]"))
