from pathlib import Path

import pytest

from tests.support.records_on_disk import write_report

BASE = [20.0, 21.0, 22.0, 23.0]


@pytest.fixture(autouse=True)
def worse(tmp_path, monkeypatch):
    """Two reports, ``a`` and ``b``, of which the second is 1 dB worse by one method."""
    monkeypatch.chdir(tmp_path)
    write_report(Path("a"), {("toy", "bench"): BASE, ("kept", "bench"): BASE}, {"revision": "one"})
    write_report(Path("b"), {("toy", "bench"): [19.1, 19.9, 21.1, 21.9], ("kept", "bench"): BASE}, {"revision": "two"})


def test_differences_are_printed_and_written(call):
    code, printed, _ = call("compare", "a", "b", "--output", "out")
    assert (code, "-1.000" in printed, "revision" in printed) == (0, True, True)
    assert "| toy | bench | 4 | 21.50 | 20.50 | -1.000" in Path("out/compare.md").read_text()
    row = Path("out/compare.csv").read_text().splitlines()[1]
    assert row.startswith("toy,bench,bench,psnr_linear,dB,4,4,21.5,20.5,-1")


@pytest.mark.parametrize(("limit", "code"), [(0.9, 1), (1.1, 0)])
def test_a_regression_beyond_the_limit_is_exit_code_1(call, limit, code):
    ended, printed, _ = call("compare", "a", "b", "--fail-on-regression", limit)
    assert ended == code
    assert ("worse by more than 0.9 dB: toy on bench" in printed) == (code == 1)


def test_a_method_that_is_gone_is_a_regression(call):
    write_report(Path("c"), {("kept", "bench"): BASE})
    code, printed, _ = call("compare", "a", "c", "--fail-on-regression", 9)
    assert (code, "without scores that A has: toy on bench" in printed) == (1, True)
    assert call("compare", "a", "c")[0] == 0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("a", "nowhere"), "nowhere: no records.csv in this folder"),
        (("a", "b", "--displays", "bench"), "--displays bench: expected a display of A and one of B"),
        (("a", "b", "--displays", "bench=x"), "b has no display 'x'; allowed: bench"),
        (("a", "b", "--displays", "bench=bench", "--displays", "bench=x"), "'bench' is paired already"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(call, arguments, message):
    code, _, error = call("compare", *arguments)
    assert (code, error.count("\n")) == (2, 1)
    assert message in error


def test_equal_rows_are_counted_and_the_others_come_first(call):
    better = {("fine", "bench"): [20.0, 21.0, 22.1, 23.2]}
    equal = {(f"kept {number}", "bench"): BASE for number in range(21)}
    write_report(Path("a"), equal | {("fine", "bench"): BASE})
    write_report(Path("b"), equal | better)
    code, printed, _ = call("compare", "a", "b", "--output", "out")
    assert code == 0
    assert "1 not shown and 21 equal, in which no target has changed and which are not listed" in printed
    assert "fine" in printed
    assert "kept" not in printed + Path("out/compare.md").read_text()
    rows = Path("out/compare.csv").read_text().splitlines()
    assert rows[1].startswith("fine")
    assert sum(row.startswith("kept") for row in rows) == 21


def test_a_provenance_cannot_control_the_terminal(tmp_path, call):
    for name, sign in (("a", "\x1b[31m"), ("b", "\x1b[2J\n")):
        write_report(tmp_path / name, {("toy", "bench"): BASE}, {"cpu": f"chip{sign}", "packages": {f"x{sign}": sign}})
    code, printed, _ = call("compare", tmp_path / "a", tmp_path / "b", "--output", tmp_path / "out")
    assert code == 0
    text = printed + (tmp_path / "out" / "compare.md").read_text()
    assert ("chip?[31m" in text, "\x1b" in text) == (True, False)
