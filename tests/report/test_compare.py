"""Two runs are compared cell by cell, and written as a page."""

import csv
import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from holobench_eval.core.errors import UserError
from holobench_eval.report.compare import Comparison, compare, read_run
from holobench_eval.report.results import csv_text
from holobench_eval.report.statistics import family_p, mean_interval
from tests.support.records_on_disk import Scores, write_report

BASE = [20.0, 21.0, 22.0, 23.0]
HOSTILE = ("<script>alert(1)</script>", "a | b", "=cmd()", "[x](http://example.org)", "*bold*")


def compared(folder: Path, a: Scores, b: Scores, known: Sequence[Any] = (None, None), **options: Any) -> Comparison:
    return compare(write_report(folder / "a", a, known[0]), write_report(folder / "b", b, known[1]), **options)


def shifted(by: float, spread: float = 0.1) -> list[float]:
    """``BASE`` with a mean change and a spread of it [dB]."""
    return [value + by + spread * sign for value, sign in zip(BASE, (1, -1, 1, -1), strict=True)]


def verdicts(comparison: Comparison) -> dict[str, str]:
    return dict(zip(comparison.rows["method"], comparison.rows["verdict"], strict=True))


def change(path: Path, **columns: Any) -> None:
    """Write records.csv with columns made anew from those that there are."""
    frame = pd.read_csv(path / "records.csv")
    (path / "records.csv").write_text(csv_text(frame.assign(**columns)))


def test_a_difference_is_b_minus_a_with_its_interval_over_clusters(tmp_path: Path) -> None:
    row = compared(tmp_path, {("m", "d"): BASE}, {("m", "d"): shifted(0.5)}).rows.iloc[0]
    wanted = mean_interval(np.subtract(shifted(0.5), BASE), ["t0", "t1", "t2", "t3"])
    assert [row["difference"], row["difference_low"], row["difference_high"]] == [wanted.mean, wanted.low, wanted.high]
    assert wanted.mean == pytest.approx(0.5, abs=1e-4)


def test_regressions_come_first_the_largest_before_the_others_and_equal_rows_last(tmp_path: Path) -> None:
    changes = {"up": shifted(1), "noisy": shifted(-5, 90), "same": BASE, "down": shifted(-1), "far down": shifted(-3)}
    a, b = ({(name, "d"): each for name, each in own.items()} for own in (dict.fromkeys(changes, BASE), changes))
    wanted = {"far down": "worse", "down": "worse", "noisy": "not shown", "up": "better", "same": "equal"}
    assert [*verdicts(compared(tmp_path, a, b)).items()] == [*wanted.items()]


def test_less_is_better_where_the_score_says_so_and_two_clusters_give_no_verdict(tmp_path: Path) -> None:
    """FLIP of these records falls where PSNR rises."""
    assert verdicts(compared(tmp_path, {("m", "d"): BASE[:2]}, {("m", "d"): [1.0, 1.0]})) == {"m": "too few clusters"}
    comparison = compared(tmp_path, {("m", "d"): BASE}, {("m", "d"): shifted(1)}, metric="flip_srgb")
    assert comparison.rows["difference"][0] < 0
    assert verdicts(comparison) == {"m": "better"}


def test_displays_of_other_names_are_paired_where_they_are_stated(tmp_path: Path) -> None:
    a = {("m", "old"): BASE, ("m", "kept"): BASE, ("floor", "reference"): BASE}
    b = {("m", "new"): shifted(1), ("m", "kept"): BASE, ("floor", "reference"): BASE}
    plain = compared(tmp_path, a, b)
    assert {*plain.rows["display"]} == {"kept", "reference"}
    alone = [["A", "m", "old", "4", "no such row"], ["B", "m", "new", "4", "no such row"]]
    assert plain.unpaired.to_numpy().tolist() == alone
    stated = compared(tmp_path, a, b, displays={"old": "new"})
    assert {*stated.rows["display"]} == {"old = new", "reference"}
    assert stated.unpaired.empty


def test_two_displays_of_one_report_can_be_compared(tmp_path: Path) -> None:
    run = write_report(tmp_path, {("m", "x"): BASE, ("m", "y"): shifted(1)})
    rows = compare(run, run, displays={"x": "y"}).rows
    assert rows[["display", "verdict"]].to_numpy().tolist() == [["x = y", "better"]]


def test_reference_rows_go_with_the_display_of_their_targets(tmp_path: Path) -> None:
    """Displays of other sizes have rows of their own, and the first of a study has those without a name."""
    names = ("reference", "reference for y"), ("reference for x", "reference")
    runs = []
    for name, (of_x, of_y), gain in zip("ab", names, (0, 1), strict=True):
        scores = {("f", of_x): shifted(gain), ("f", of_y): shifted(10 + gain), ("m", "x"): BASE, ("m", "y"): BASE}
        runs.append(write_report(tmp_path / name, scores))
        change(runs[-1], display=lambda rows, own={of_x: "x", of_y: "y"}: rows["condition"].replace(own))
    rows = compare(*runs).rows.query("method == 'f'")
    assert rows["difference"].tolist() == pytest.approx([1, 1])
    assert {*zip(rows["display_a"], rows["display_b"], strict=True)} == {*zip(*names, strict=True)}


def test_a_cell_that_failed_or_is_in_one_run_alone_is_in_no_mean_and_is_listed(tmp_path: Path) -> None:
    comparison = compared(tmp_path, {("m", "d"): BASE[:3]}, {("m", "d"): [None, *BASE[1:]]})
    assert comparison.rows[["targets", "mean_a"]].to_numpy().tolist() == [[2, 21.5]]
    failed, alone = ["A", "m", "d", "1", "failed: no light"], ["B", "m", "d", "1", "no such target or repeat"]
    assert comparison.unpaired.to_numpy().tolist() == [failed, alone]


def test_p_values_of_methods_with_holes_are_those_of_their_targets(tmp_path: Path) -> None:
    before, names = [*BASE, 24.0], [f"t{index}" for index in range(5)]
    after = {"m": [*shifted(0.5), 25.0], "n": [None, 21.4, None, 23.2, 24.9], "o": [20.3, None, 22.1, 23.4, 24.1]}
    rows = compared(tmp_path, {(m, "d"): before for m in after}, {(m, "d"): new for m, new in after.items()}).rows
    changes = np.array(list(after.values()), dtype=np.float64) - before  # of None: NaN
    wanted = dict(zip(after, family_p(changes, names), strict=True))
    assert dict(zip(rows["method"], rows["p_adjusted"], strict=True)) == pytest.approx(wanted)


def test_the_targets_that_changed_most_come_first(tmp_path: Path) -> None:
    title, sentence, text = compared(tmp_path, {("m", "d"): BASE}, {("m", "d"): [20.0, 21.5, 19.0, 23.1]}).parts[1]
    assert (title, sentence) == ("Targets that changed most", "The 3 largest changes of a target.")
    assert text[["target", "B - A"]].to_numpy().tolist() == [["t2", "-3.000"], ["t1", "+0.500"], ["t3", "+0.100"]]


def test_cells_of_one_identity_are_counted_and_another_protocol_is_named(tmp_path: Path) -> None:
    a, b = (write_report(tmp_path / name, {("m", "d"): BASE}) for name in "ab")
    assert "Of 4 paired cells, all have one identity" in compare(a, b).markdown
    change(b, cell=lambda rows: rows["cell"].replace("m d 3", "another"), protocol="v2")
    text = compare(a, b).markdown
    assert "Of 4 paired cells, 3 have one identity" in text
    assert "A is scored by metric protocol 1 and B by v2." in text


def test_only_facts_that_differ_are_listed(tmp_path: Path) -> None:
    facts = {"revision": "aaa", "cpu": "one", "packages": {"torch": "2"}, "started": "monday"}
    profiles = [{"bench": {"version": 1, "sha256": digest * 64}} for digest in "01"]
    more = {"revision": "bbb", "started": "tuesday", "harness": "4", "profiles": profiles[1]}
    runs = {("toy", "bench"): BASE}
    *_, text = compared(tmp_path, runs, runs, (facts | {"profiles": profiles[0]}, facts | more)).parts[-1]
    assert text.to_numpy().tolist() == [
        ["revision", "aaa", "bbb"],
        ["display bench", f"version 1, sha256 {'0' * 12}", f"version 1, sha256 {'1' * 12}"],
        ["harness", "not recorded", "4"],
    ]


@pytest.mark.parametrize("text", ["", "a,b\n1,2\n", "\0", "twice"])
def test_a_file_that_is_no_table_of_records_is_one_line(tmp_path: Path, text: str) -> None:
    path = write_report(tmp_path, {("toy", "bench"): BASE}) / "records.csv"
    path.write_text(path.read_text() + path.read_text().splitlines()[1] + "\n" if text == "twice" else text)
    with pytest.raises(UserError, match=rf"^{tmp_path}[^\n]*$"):
        read_run(tmp_path)


@pytest.mark.parametrize(
    ("b", "options", "message"),
    [
        ({("n", "d"): BASE}, {}, "no scored cell in common"),
        ({("m", "d"): BASE}, {"metric": "psnr_liner"}, "did you mean 'psnr_linear'"),
        ({("m", "d"): BASE}, {"displays": {"d": "e"}}, "has no display 'e'; allowed: d"),
        ({("m", "d"): BASE}, {"displays": {"x": "d", "d": "d"}}, "two displays of A are paired with one of B"),
    ],
)
def test_what_cannot_be_compared_is_one_line(tmp_path: Path, b: Scores, options: dict[str, Any], message: str) -> None:
    with pytest.raises(UserError, match=rf"^[^\n]*{message}[^\n]*$"):
        compared(tmp_path, {("m", "d"): BASE, ("m", "x"): BASE}, b, **options)


def test_markdown_and_csv_have_the_same_numbers_and_hostile_names_stay_text(tmp_path: Path) -> None:
    runs = [{(name, "bench"): values for name in HOSTILE} for values in ([20.0, 21.0, 22.0], [20.5, 21.4, 22.6])]
    comparison = compared(tmp_path, *runs)
    text, rows = comparison.markdown, [*csv.DictReader(io.StringIO(comparison.csv))]
    mean, low, high = (float(rows[0][f"difference{end}"]) for end in ("", "_low", "_high"))
    assert text.count(f"{mean:+.3f} [{low:+.3f}, {high:+.3f}]") == len(HOSTILE)
    assert (rows[0]["unit"], rows[0]["targets"], rows[0]["verdict"]) == ("dB", "3", "better")
    assert not {"<script>", "[x](http"} & {part for part in ("<script>", "[x](http") if part in text}
    assert "*bold*" not in text.replace("\\*", "")
    table = text[text.index("| method") :].split("\n\n")[0].splitlines()
    assert {line.replace("\\|", "").count("|") for line in table} == {8}
    assert {row["method"].lstrip("'") for row in rows} == {*HOSTILE}
    assert not any(row["method"].startswith("=") for row in rows)
