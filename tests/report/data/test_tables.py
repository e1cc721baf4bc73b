import io

import numpy as np
import pandas as pd
import pytest

from holobench_eval.core.errors import UserError
from holobench_eval.report import Results, csv_text, read_records, recompute_files, records_frame, table_from_records
from holobench_eval.study.plan import FLOORS, REFERENCE
from tests.support import synthetic_study as synthetic

PLAIN = synthetic.layout(
    pairs=(("b", "bench"), ("a", "bench")), targets=("t2", "t1"), baseline="b", reported={}, privileged=frozenset()
)


def rows(values, label="a", repeats=1, **changes):
    """Done records of a method, a value of psnr_linear per target and repeat."""
    return [
        synthetic.record(
            label, synthetic.cell(label, target, "bench", repeat=repeat), {"psnr_linear": value + repeat}, **changes
        )
        for target, value in values.items()
        for repeat in range(repeats)
    ]


def row_of(table, label):
    return table[table["label"] == label].iloc[0]


@pytest.fixture(scope="module")
def records(tmp_path_factory):
    return synthetic.study(tmp_path_factory.mktemp("study"), size=32, targets=synthetic.TARGETS[:3])


def test_a_table_from_the_written_records_has_the_same_bytes_and_its_rows_follow_the_config(records):
    found = Results(records_frame(records, synthetic.layout()), synthetic.layout())
    written = csv_text(found.frame)
    assert recompute_files(written, found.layout)["table.csv"] == csv_text(found.table)
    rows = list(zip(found.table["label"], found.table["condition"], strict=True))
    assert rows == [*synthetic.layout().pairs, *((name, REFERENCE) for name in FLOORS)]


def test_clusters_and_the_median_stand_in_the_table_and_widen_the_interval():
    found = rows({"t1": 1.0, "t2": 1.5, "t3": 4.0, "t4": 4.5, "t5": 2.0, "t6": 2.5})
    alone = {"targets": ("t1", "t2", "t3", "t4", "t5", "t6"), "pairs": (("a", "bench"),), "baseline": None}
    grouped = alone | {"clusters": dict(zip(alone["targets"], "ppqqrr", strict=True))}
    wide, narrow = (
        row_of(Results(records_frame(found, layout), layout).table, "a")
        for layout in (synthetic.layout(**grouped), synthetic.layout(**alone))
    )
    assert (wide["n"], wide["clusters"], wide["psnr_linear_median_db"]) == (6, 3, 2.25)
    assert wide["psnr_linear_db"] == narrow["psnr_linear_db"]
    assert wide["psnr_linear_lo_db"] < narrow["psnr_linear_lo_db"]
    assert narrow["clusters"] == 6


def test_targets_keep_the_order_of_the_dataset():
    frame = records_frame(rows({"t1": 1.0, "t2": 2.0}), PLAIN)
    assert list(frame["target"]) == ["t2", "t1"]


def test_cells_without_a_score_are_counted_and_are_in_no_mean():
    lost = rows({"t1": 0.0, "t2": 0.0}, label="b", state="unavailable", reason="needs a camera")
    failed = rows({"t1": 1.0}, state="failed", reason="no light")
    table = table_from_records(records_frame([*lost, *failed, *rows({"t2": 2.0})], PLAIN), PLAIN)
    assert (row_of(table, "a")["n"], row_of(table, "a")["failed"], row_of(table, "a")["psnr_linear_db"]) == (1, 1, 2.0)
    assert (row_of(table, "b")["n"], row_of(table, "b")["failed"]) == (0, 2)
    assert np.isnan(row_of(table, "b")["psnr_linear_db"])


def test_repeats_are_averaged_within_a_target_first():
    several = [*rows({"t1": 10.0}, repeats=3), *rows({"t2": 20.0})]
    row = row_of(table_from_records(records_frame(several, PLAIN), PLAIN), "a")
    assert row["n"] == 2
    assert row["psnr_linear_db"] == pytest.approx((11.0 + 20.0) / 2)


def test_a_metric_that_some_targets_lack_has_no_mean():
    partial = rows({"t1": 10.0, "t2": 20.0})
    partial[0]["scores"] |= {"ssim_linear": 0.5, "speckle_contrast": 0.3}
    row = row_of(table_from_records(records_frame(partial, PLAIN), PLAIN), "a")
    assert np.isnan(row["ssim_linear"])
    assert row["speckle_contrast"] == 0.3


def test_numbers_have_six_significant_digits():
    text = csv_text(records_frame(rows({"t1": 12.3456789}, seconds=1 / 3), PLAIN))
    assert ",12.3457," in text
    assert ",0.333333," in text


ALONE = {"t1": (5.0, False), "t2": (3.0, True)}
"""Seconds of each target, and whether they were measured alone."""


def timed(label="a", alone=ALONE):
    return [
        synthetic.record(
            label, synthetic.cell(label, target, "bench"), {"psnr_linear": 1.0}, seconds=seconds, alone=quiet
        )
        for target, (seconds, quiet) in alone.items()
    ]


def test_the_seconds_of_a_row_are_those_of_what_was_timed_alone_if_anything_was():
    frame = records_frame([*timed(), *timed("b", {"t1": (5.0, False), "t2": (3.0, False)})], PLAIN)
    table = table_from_records(frame, PLAIN)
    assert row_of(table, "a")["solving_s"] == 3.0
    assert row_of(table, "b")["solving_s"] == 4.0
    again = read_records(csv_text(frame))
    assert csv_text(table_from_records(again, PLAIN)) == csv_text(table)


def test_records_that_do_not_say_what_was_beside_them_have_no_column_for_it_and_all_their_seconds_count():
    old = [{key: value for key, value in record.items() if key != "alone"} for record in timed()]
    frame = records_frame(old, PLAIN)
    assert "timed_alone" not in frame
    assert row_of(table_from_records(frame, PLAIN), "a")["solving_s"] == 4.0


@pytest.mark.parametrize("label", ["NA", "nan", "a,b", 'say "x"', "1e5", " padded ", "é"])
def test_labels_survive_being_written_and_read(label):
    layout = synthetic.layout(pairs=((label, "bench"),), targets=("t1",), reported={})
    text = csv_text(records_frame(rows({"t1": 1.0}, label=label), layout))
    assert list(read_records(text)["label"]) == [label]
    assert csv_text(read_records(text)) == text


def test_a_reason_with_line_breaks_stays_on_its_row():
    frame = records_frame(rows({"t1": 1.0}, state="failed", reason="first\nsecond,\r\nthird"), PLAIN)
    read = pd.read_csv(io.StringIO(csv_text(frame)))
    assert list(read["reason"]) == ["first second, third"]


def test_a_score_named_like_a_column_is_refused():
    bad = rows({"t1": 1.0})
    bad[0]["scores"]["captures"] = 1.0
    with pytest.raises(UserError, match="captures"):
        records_frame(bad, PLAIN)


def test_published_figures_have_columns_of_their_own_beside_the_display_they_belong_to(records):
    layout = synthetic.layout(reported_beside="leto-aged")
    table = table_from_records(records_frame(records, layout), layout)
    assert row_of(table, "HIL")["reported_psnr_db"] == 20.5
    assert np.isnan(row_of(table, "GS")["reported_psnr_db"])
    assert row_of(table, "HIL")["psnr_linear_db"] != 20.5
    assert set(table[table["reported_psnr_db"].notna()]["condition"]) == {"leto-aged"}
