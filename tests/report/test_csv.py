"""records.csv, table.csv and tests.csv: complete without the config, and the same numbers as the report's."""

import io
import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from holobench_eval.core.errors import UserError
from holobench_eval.report import Results, csv_text, facts_of, read_records, records_frame
from holobench_eval.report.facts import Swept
from holobench_eval.report.results import of_study
from holobench_eval.study.config import load_study
from holobench_eval.study.plan import REFERENCE
from tests.report.stories import test_sweeps as swept_study
from tests.support import synthetic_study as synthetic

ROOT = Path(__file__).parents[2]
TARGETS = tuple(f"t{number}" for number in range(8))
PARAMS = {"iterations": 200, "offset": None}


GIVEN = {
    "pairs": (("wirtinger, 200", "leto-aged"), ("hil", "leto-aged")),
    "targets": TARGETS,
    "clusters": {target: f"photo {index // 2}" for index, target in enumerate(TARGETS)},
    "baseline": "wirtinger, 200",
    "study": "toy",
    "seed": 20_261_123,
    "params": {"wirtinger, 200": PARAMS},
    "limits": {"hil": 25},
    "panels": {"leto-aged": (192, 256)},
}


def results(**changes: object) -> Results:
    found = [
        synthetic.record(
            label,
            synthetic.cell(name, target, "leto-aged"),
            {"psnr_linear": 17.0 + index + (label == "hil") * (0.4 * index - 0.5)},
        )
        for label, name in (("wirtinger, 200", "wirtinger"), ("hil", "hil"))
        for index, target in enumerate(TARGETS)
    ]
    floor = synthetic.cell("floor_constant", "t0", REFERENCE)
    found.append(synthetic.record("floor_constant", floor, {"psnr_linear": 9.0}))
    return synthetic.results(found, **(GIVEN | changes))


def read(frame: pd.DataFrame) -> pd.DataFrame:
    return pd.read_csv(io.StringIO(csv_text(frame)))


def test_a_record_says_what_it_is_without_the_config() -> None:
    row = read(results().frame).iloc[0]
    names = ["study", "measure", "display", "condition", "method", "label", "category", "target", "cluster", "state"]
    assert row[names].tolist() == [
        *("toy", "picture", "leto-aged", "leto-aged", "wirtinger", "wirtinger, 200"),
        *("open loop", "t0", "photo 0", "done"),
    ]
    numbers = ["panel_height_px", "panel_width_px", "repeat", "seed", "psnr_linear_db"]
    assert row[numbers].tolist() == [192, 256, 0, 20_261_123, 17.0]


def test_a_limit_of_captures_and_the_floor_are_told_apart() -> None:
    cells = read(results().frame).set_index("label")
    assert set(cells.loc["hil", "capture_limit"]) == {25}
    assert cells.loc["wirtinger, 200", "capture_limit"].isna().all()
    assert cells.loc["floor_constant", ["category", "condition"]].tolist() == ["floor", REFERENCE]


def test_a_swept_quantity_is_a_number_with_a_unit_or_a_name() -> None:
    made = swept_study.facts()
    cells = read(records_frame(swept_study.records(), made))
    points = cells.drop_duplicates("condition").set_index("condition")[["swept", "swept_value", "swept_unit"]]
    assert points.loc["leto-aged, drift 30.0"].tolist() == ["drift", 30.0, "days"]
    assert points.loc["leto-aged, camera_shift_x -20.0"].tolist() == ["camera_shift_x", -20.0, "mm"]
    assert points.loc["leto-aged"].isna().all()
    eyes = cells[cells["swept"] == "eye"]
    assert eyes["swept_value"].isna().all()
    assert set(eyes["swept_name"].str.removeprefix("'")) == {"-2"}
    assert set(cells["display"]) == {"leto-aged"}


def test_a_ratio_has_the_unit_one_and_a_draw_its_number() -> None:
    points = {"laser_power": (0.5, "leto-aged, laser power 0.5 of the nominal"), "draw": ("7", "leto-aged, draw 7")}
    found = [
        synthetic.record("hil", synthetic.cell("hil", "t0", condition, profile="leto-aged"), {"psnr_linear": 1.0})
        for _, condition in points.values()
    ]
    sweeps = tuple(Swept(kind, "leto-aged", (point,)) for kind, point in points.items())
    cells = synthetic.results(found, sweeps=sweeps).frame.set_index("swept")
    assert cells.loc["laser_power", ["swept_value", "swept_unit"]].tolist() == [0.5, "1"]
    assert cells.loc["draw", ["swept_value", "swept_unit"]].tolist() == [7.0, ""]


def test_the_plane_of_a_focal_stack_is_a_swept_quantity() -> None:
    planes = {target: ("scene", float(index)) for index, target in enumerate(TARGETS)}
    cells = results(planes=planes, measure="focus").frame
    found = cells[cells["label"] == "hil"].set_index("target").loc["t3", ["swept", "swept_value", "swept_unit"]]
    assert found.tolist() == ["plane", 3.0, "mm"]


@pytest.mark.parametrize("report", ["table3", "table1", "error-budget"])
def test_committed_records_are_read_and_written_without_a_loss(report: str) -> None:
    text = (ROOT / "reports" / report / "records.csv").read_text()
    made = facts_of(load_study(ROOT / "configs" / f"{report}.yaml"))
    frame = read_records(text)
    assert text == csv_text(frame)
    pd.testing.assert_frame_equal(of_study(frame, made), frame)
    assert len(frame) > 400


def test_the_table_leads_with_what_it_is_a_table_of_and_has_the_parameters_of_methods() -> None:
    found = results()
    table = read(found.table).set_index("label")
    first = table.loc["hil", ["study", "method", "display", "n", "clusters"]]
    assert first.tolist() == ["toy", "hil", "leto-aged", 8, 4]
    assert table.loc["hil", "psnr_linear_db"] == pytest.approx(17 + 3.5 + 0.9)
    assert table.loc["floor_constant", "category"] == "floor"
    assert json.loads(table.loc["wirtinger, 200", "parameters"]) == PARAMS
    assert "parameters" not in found.frame


def test_a_paired_test_has_the_numbers_of_the_report() -> None:
    found = results()
    (expected,) = found.tests.values()
    tests = read(found.tests_table)
    assert len(tests) == 1
    row = tests.iloc[0]
    names = row[["study", "display", "method", "label", "baseline", "metric"]].tolist()
    assert names == ["toy", "leto-aged", "hil", "hil", "wirtinger, 200", "psnr_linear_db"]
    assert row[["n", "clusters", "better"]].tolist() == [8, 4, 6]
    numbers = row[["difference_db", "difference_lo_db", "difference_hi_db", "p_adjusted"]].astype(float).tolist()
    estimate = expected.estimate
    assert numbers == pytest.approx([estimate.mean, estimate.low, estimate.high, expected.p], rel=1e-5)
    assert row["difference_median_db"] == pytest.approx(np.median(0.4 * np.arange(8) - 0.5))


def test_the_tests_of_a_study_without_a_baseline_are_a_heading_alone() -> None:
    assert len(csv_text(results(baseline=None).tests_table).splitlines()) == 1


HOSTILE = [
    *("=1+1", "+cmd|' /C calc'!A0", "-2", "@SUM(A1)", "\t=1", "'=1", "''@x", "＝1", "a|b", "<script>alert(1)</script>"),
    *('say "=x", please', "'plain'"),
]


@pytest.mark.parametrize("name", HOSTILE)
def test_text_is_never_a_formula_and_comes_back_as_it_was(name: str) -> None:
    found = [synthetic.record(name, synthetic.cell(name, name, "leto-aged"), {"psnr_linear": -1.5})]
    text = csv_text(synthetic.results(found, clusters={name: "="}, baseline=None).frame)
    cells = pd.read_csv(io.StringIO(text), dtype=str, keep_default_na=False).iloc[0]
    written = [cells[column] for column in ("method", "label", "target", "cluster")]
    assert not any(value.lstrip()[:1] in tuple("=+-@＝＋－＠") for value in written)
    again = read_records(text).iloc[0]
    assert again[["method", "label", "target", "cluster"]].tolist() == [name, name, name, "="]
    assert (cells["psnr_linear_db"], again["psnr_linear_db"]) == ("-1.5", -1.5)


def test_the_name_of_a_column_is_never_a_formula() -> None:
    assert csv_text(pd.DataFrame({"=1+1": [-1.5], "n": [2]})) == "'=1+1,n\n-1.5,2\n"


def test_a_number_that_is_none_or_lacks_is_refused_by_the_name_of_its_column() -> None:
    found = results().frame
    with pytest.raises(UserError, match=r"records.csv, column solving_s: could not convert"):
        read_records(csv_text(found).replace(",done,,17,0,,", ",done,,17,0,soon,"))
    with pytest.raises(UserError, match="lacks the columns solving_s"):
        read_records(csv_text(found.drop(columns="solving_s")))
