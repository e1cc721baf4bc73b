"""The numbers of the page are those of table.csv and records.csv, and its texts those of report.md."""

from __future__ import annotations

import csv
import json

from holobench_eval.report.data.scores import parse

from .conftest import Written


def number(text: str) -> float | None:
    return float(text) if text else None


def table(written: Written, name: str) -> list[dict[str, str]]:
    with (written.folder / name).open(newline="") as file:
        # an apostrophe keeps a spreadsheet from running a name
        return [{key: text.removeprefix("'") for key, text in row.items()} for row in csv.DictReader(file)]


def test_every_number_of_the_table_is_that_of_table_csv(written: Written) -> None:
    rows = {(row["label"], row["condition"]): row for row in table(written, "table.csv")}
    compared = 0
    for condition, found in written.data["rows"].items():
        for row in found:
            expected = rows.pop((row["method"], condition))
            for key, cell in row["cells"].items():
                score = parse(key)
                if score.column in expected:
                    assert cell["value"] == number(expected[score.column])
                    assert cell.get("low") == number(expected.get(score.statistic("_lo"), ""))
                    assert cell.get("high") == number(expected.get(score.statistic("_hi"), ""))
                    compared += cell["value"] is not None
    assert compared > 60
    assert {condition for _, condition in rows} == {"reference"}  # the floor is beside the table


def test_the_value_of_every_target_is_that_of_records_csv(written: Written) -> None:
    names = written.data["targets"]
    compared = 0
    for row in table(written, "records.csv"):
        if row["condition"] in written.data["values"]:
            values = written.data["values"][row["condition"]][row["label"]]
            for key, found in values.items():
                assert found[names.index(row["target"])] == number(row[parse(key).column])
                compared += 1
    assert compared > 100


def test_means_and_differences_are_those_of_the_board(written: Written) -> None:
    (lacking,) = (row for row in written.data["rows"]["leto-aged"] if "3 of 4 targets" in row["marked"])
    assert "gain" not in lacking["cells"]
    drawn = json.loads((written.folder / "board.json").read_text())
    for display in drawn["displays"]:
        own = {row["method"]: row for group in display["groups"] for row in group["rows"]}
        for row in written.data["rows"][display["name"]]:
            assert row["cells"]["psnr_linear"]["value"] == own[row["method"]]["score"]["mean"]
            if own[row["method"]]["difference"]:
                assert row["cells"]["gain"]["value"] == own[row["method"]]["difference"]["mean"]
