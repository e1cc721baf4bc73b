"""Two runs are read, compared cell by cell, and written as a page."""

import csv as reader
import io
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from holobench_eval.core.errors import UserError
from holobench_eval.report.compare.page import csv, markdown
from holobench_eval.report.compare.paired import Comparison, Unpaired, compare, provenance_differences, read_run
from holobench_eval.report.results import csv_text
from holobench_eval.report.statistics import family_p, mean_interval
from tests.support.records_on_disk import Scores, write_report

SCORES = {("toy", "bench"): [20.0, 21.0, 22.0]}


def test_only_facts_that_differ_are_listed(tmp_path: Path) -> None:
    facts = {"revision": "aaa", "cpu": "one", "packages": {"torch": "2"}, "started": "monday"}
    profiles = [{"bench": {"version": 1, "sha256": digest * 64}} for digest in "01"]
    a = read_run(write_report(tmp_path / "a", SCORES, {**facts, "profiles": profiles[0]}))
    known = {**facts, "revision": "bbb", "started": "tuesday", "harness": "4", "profiles": profiles[1]}
    b = read_run(write_report(tmp_path / "b", SCORES, known))
    assert provenance_differences(a, b) == [
        ("revision", "aaa", "bbb"),
        ("display bench", f"version 1, sha256 {'0' * 12}", f"version 1, sha256 {'1' * 12}"),
        ("harness", "not recorded", "4"),
    ]


def test_a_folder_without_records_is_refused_and_a_cell_that_is_there_twice_is_named(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"no records\.csv in this folder; expected the folder of a report"):
        read_run(tmp_path)
    path = write_report(tmp_path, SCORES) / "records.csv"
    path.write_text(path.read_text() + path.read_text().splitlines()[1] + "\n")
    with pytest.raises(UserError, match=r"two rows for one cell \(toy, bench, t0\)"):
        read_run(tmp_path)


@pytest.mark.parametrize("text", ["", "a,b\n1,2\n", "\0"])
def test_a_file_that_is_no_table_of_records_is_one_line(tmp_path: Path, text: str) -> None:
    (tmp_path / "records.csv").write_text(text)
    with pytest.raises(UserError) as error:
        read_run(tmp_path)
    assert str(error.value).startswith(str(tmp_path))
    assert "\n" not in str(error.value)


BASE = [20.0, 21.0, 22.0, 23.0]


def compared(folder: Path, a: Scores, b: Scores, **options: object) -> Comparison:
    runs = [read_run(write_report(folder / name, scores)) for name, scores in (("a", a), ("b", b))]
    return compare(*runs, **options)  # type: ignore[arg-type]


def shifted(by: float, spread: float = 0.1) -> list[float]:
    """``BASE`` with a mean change and a spread of it [dB]."""
    return [value + by + spread * sign for value, sign in zip(BASE, (1, -1, 1, -1), strict=True)]


def test_a_difference_is_b_minus_a_with_its_interval_over_clusters(tmp_path: Path) -> None:
    row = compared(tmp_path, {("m", "d"): BASE}, {("m", "d"): shifted(0.5)}).rows[0]
    assert row.change == mean_interval(np.subtract(shifted(0.5), BASE), ["t0", "t1", "t2", "t3"])
    assert row.change.mean == pytest.approx(0.5, abs=1e-4)
    assert row.verdict == "better"


def test_regressions_come_first_the_largest_before_the_others_and_equal_rows_last(tmp_path: Path) -> None:
    a = {(name, "d"): BASE for name in ("up", "noisy", "same", "down", "far down")}
    changes = {"up": shifted(1), "noisy": shifted(-5, 90), "same": BASE, "down": shifted(-1), "far down": shifted(-3)}
    comparison = compared(tmp_path, a, {(name, "d"): values for name, values in changes.items()})
    verdicts = {"far down": "worse", "down": "worse", "noisy": "not shown", "up": "better", "same": "equal"}
    assert [(row.method, row.verdict) for row in comparison.rows] == list(verdicts.items())
    assert [row.method for row in comparison.regressions(0.9)] == ["far down", "down"]  # beyond a limit, and clear
    assert [row.method for row in comparison.regressions(1.1)] == ["far down"]


def test_less_is_better_where_the_score_says_so_and_two_clusters_give_no_verdict(tmp_path: Path) -> None:
    """FLIP of these records falls where PSNR rises."""
    few = compared(tmp_path, {("m", "d"): BASE[:2]}, {("m", "d"): [1.0, 1.0]})
    assert few.rows[0].verdict == "too few clusters"
    assert few.regressions(0) == []
    comparison = compared(tmp_path, {("m", "d"): BASE}, {("m", "d"): shifted(1)}, metric="flip_srgb")
    assert comparison.rows[0].change.mean < 0
    assert comparison.rows[0].verdict == "better"


def test_displays_of_other_names_are_paired_where_they_are_stated(tmp_path: Path) -> None:
    a = {("m", "old"): BASE, ("m", "kept"): BASE, ("floor", "reference"): BASE}
    b = {("m", "new"): shifted(1), ("m", "kept"): BASE, ("floor", "reference"): BASE}
    plain = compared(tmp_path, a, b)
    assert {row.display for row in plain.rows} == {"kept", "reference"}
    assert plain.unpaired == (Unpaired("A", "m", "old", 4, "no such row"), Unpaired("B", "m", "new", 4, "no such row"))
    stated = compared(tmp_path, a, b, displays={"old": "new"})
    assert {row.display for row in stated.rows} == {"old = new", "reference"}
    assert stated.unpaired == ()


def test_reference_rows_go_with_the_display_of_their_targets(tmp_path: Path) -> None:
    """Displays of other sizes have rows of their own, and the first of a study has those without a name."""
    names = ("reference", "reference for y"), ("reference for x", "reference")
    runs = []
    for name, (of_x, of_y), gain in zip("ab", names, (0, 1), strict=True):
        scores = {("f", of_x): shifted(gain), ("f", of_y): shifted(10 + gain), ("m", "x"): BASE, ("m", "y"): BASE}
        file = write_report(tmp_path / name, scores) / "records.csv"
        rows = pd.read_csv(io.StringIO(file.read_text()))
        rows["display"] = rows["condition"].replace({of_x: "x", of_y: "y"})
        file.write_text(csv_text(rows))
        runs.append(read_run(file.parent))
    found = [row for row in compare(*runs).rows if row.method == "f"]
    assert [row.change.mean for row in found] == pytest.approx([1, 1])
    assert {row.displays for row in found} == {*zip(*names, strict=True)}


def test_two_displays_of_one_report_can_be_compared(tmp_path: Path) -> None:
    run = read_run(write_report(tmp_path, {("m", "x"): BASE, ("m", "y"): shifted(1)}))
    rows = compare(run, run, displays={"x": "y"}).rows
    assert [(row.display, row.verdict) for row in rows] == [("x = y", "better")]


def test_a_cell_that_failed_or_is_in_one_run_alone_is_in_no_mean_and_is_listed(tmp_path: Path) -> None:
    comparison = compared(tmp_path, {("m", "d"): BASE[:3]}, {("m", "d"): [None, *BASE[1:]]})
    assert comparison.rows[0].targets == ("t1", "t2")
    assert comparison.rows[0].a.tolist() == BASE[1:3]
    failed = Unpaired("A", "m", "d", 1, "failed: no light")
    alone = Unpaired("B", "m", "d", 1, "no such target or repeat")
    assert set(comparison.unpaired) == {failed, alone}


def test_p_values_of_methods_with_holes_are_those_of_their_targets(tmp_path: Path) -> None:
    after: dict[str, list[float | None]] = {
        "m": [*shifted(0.5), 25.0],
        "n": [None, 21.4, None, 23.2, 24.9],
        "o": [20.3, None, 22.1, 23.4, 24.1],
    }
    before = [*BASE, 24.0]
    rows = compared(tmp_path, {(m, "d"): before for m in after}, {(m, "d"): new for m, new in after.items()}).rows
    changes = np.array([[np.nan if value is None else value for value in new] for new in after.values()]) - before
    wanted = dict(zip(after, family_p(changes, [f"t{index}" for index in range(5)]), strict=True))
    assert {row.method: row.p for row in rows} == pytest.approx(wanted)


def test_the_targets_that_changed_most_come_first(tmp_path: Path) -> None:
    comparison = compared(tmp_path, {("m", "d"): BASE}, {("m", "d"): [20.0, 21.5, 19.0, 23.1]})
    assert [moved[1:] for moved in comparison.moved(2)] == [("t2", 22, 19), ("t1", 21, 21.5)]
    assert len(comparison.moved(10)) == 3


def test_cells_of_one_identity_are_counted(tmp_path: Path) -> None:
    write_report(tmp_path / "b", {("m", "d"): BASE})
    path = tmp_path / "b" / "records.csv"
    path.write_text(path.read_text().replace("m d 3", "another version"))
    comparison = compare(read_run(write_report(tmp_path / "a", {("m", "d"): BASE})), read_run(tmp_path / "b"))
    assert (comparison.cells, comparison.unchanged) == (4, 3)


@pytest.mark.parametrize(
    ("b", "options", "message"),
    [
        ({("n", "d"): BASE}, {}, "no scored cell in common"),
        ({("m", "d"): BASE}, {"metric": "psnr_liner"}, "did you mean 'psnr_linear'"),
        ({("m", "d"): BASE}, {"displays": {"d": "e"}}, "has no display 'e'; allowed: d"),
        ({("m", "d"): BASE}, {"displays": {"c": "d"}}, "has no display 'c'; allowed: d, x"),
        ({("m", "d"): BASE}, {"displays": {"x": "d", "d": "d"}}, "two displays of A are paired with one of B"),
    ],
)
def test_what_cannot_be_compared_is_one_line(tmp_path: Path, b: Scores, options: dict, message: str) -> None:
    with pytest.raises(UserError, match=message) as error:
        compared(tmp_path, {("m", "d"): BASE, ("m", "x"): BASE}, b, **options)
    assert "\n" not in str(error.value)


A, B = [20.0, 21.0, 22.0], [20.5, 21.4, 22.6]
HOSTILE = ("<script>alert(1)</script>", "a | b", "=cmd()", "[x](http://example.org)", "*bold*")


def of_methods(folder: Path, *names: str) -> Comparison:
    runs = (
        read_run(write_report(folder / run, {(name, "bench"): values for name in names}, {"revision": run}))
        for run, values in (("a", A), ("b", B))
    )
    return compare(*runs)


def test_markdown_and_csv_have_the_same_numbers_and_the_page_says_what_differs_besides(tmp_path: Path) -> None:
    comparison = of_methods(tmp_path, "toy")
    text, row = markdown(comparison), next(reader.DictReader(io.StringIO(csv(comparison))))
    mean, low, high = (float(row[f"difference{end}"]) for end in ("", "_low", "_high"))
    assert f"{mean:+.3f} [{low:+.3f}, {high:+.3f}]" in text
    assert (row["unit"], row["targets"], row["verdict"]) == ("dB", "3", "better")
    assert float(row["mean_b"]) - float(row["mean_a"]) == pytest.approx(mean, abs=1e-3)
    assert "| revision | a | b |" in text
    assert "| t2 | toy | bench | 22.00 | 22.60 | +0.600 |" in text


@pytest.mark.parametrize("name", HOSTILE)
def test_a_hostile_name_stays_text(tmp_path: Path, name: str) -> None:
    comparison = of_methods(tmp_path, name)
    text = markdown(comparison)
    assert "<script>" not in text
    assert "[x](http" not in text
    assert "*bold*" not in text.replace("\\*", "")
    table = text[text.index("| method") :].split("\n\n")[0].splitlines()
    assert {line.replace("\\|", "").count("|") for line in table} == {8}
    cell = next(reader.DictReader(io.StringIO(csv(comparison))))["method"]
    assert cell.lstrip("'") == name
    assert not cell.startswith("=")


@pytest.mark.parametrize("protocols", [("v1", "v2"), ("v2", "v2")])
def test_scores_of_two_protocols_are_never_compared_without_a_word(tmp_path: Path, protocols: tuple[str, str]) -> None:
    runs = []
    for run, protocol in zip("ab", protocols, strict=True):
        folder = write_report(tmp_path / run, {("toy", "bench"): A})
        records = (folder / "records.csv").read_text().splitlines()
        lines = [records[0], *(f"{line.rpartition(',')[0]},{protocol}" for line in records[1:])]
        (folder / "records.csv").write_text("\n".join(lines) + "\n")
        runs.append(read_run(folder))
    text = markdown(compare(*runs))
    assert ("A is scored by metric protocol v1 and B by v2." in text) == (protocols[0] != protocols[1])
