"""Facts and tables: what a config orders, and what stands in the files of a report."""

import io
import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from holobench_eval.core.errors import UserError
from holobench_eval.report import (
    Results,
    build_report,
    committed_records,
    csv_text,
    difference,
    facts_of,
    read_records,
    recompute_files,
    records_frame,
)
from holobench_eval.report.description import describe
from holobench_eval.report.scores import order_scores, parse
from holobench_eval.report.statistics import Estimate
from holobench_eval.study.config import load_study
from holobench_eval.study.plan import FLOORS, REFERENCE, plan
from tests.study.studies import compute
from tests.support import synthetic_study as synthetic
from tests.support.reports import files
from tests.support.studies.fake_study import PLUGINS, write_config

PLAIN = synthetic.facts(
    pairs=(("b", "bench"), ("a", "bench")), targets=("t2", "t1"), baseline="b", reported={}, privileged=()
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
    found = Results(records_frame(records, synthetic.facts()), synthetic.facts())
    written = csv_text(found.frame)
    assert recompute_files(written, found.facts)["table.csv"] == csv_text(found.table)
    rows = list(zip(found.table["label"], found.table["condition"], strict=True))
    assert rows == [*synthetic.facts().pairs, *((name, REFERENCE) for name in FLOORS)]


def test_clusters_and_the_median_stand_in_the_table_and_widen_the_interval():
    found = rows({"t1": 1.0, "t2": 1.5, "t3": 4.0, "t4": 4.5, "t5": 2.0, "t6": 2.5})
    alone = {"targets": ("t1", "t2", "t3", "t4", "t5", "t6"), "pairs": (("a", "bench"),), "baseline": None}
    grouped = alone | {"clusters": dict(zip(alone["targets"], "ppqqrr", strict=True))}
    wide, narrow = (
        row_of(Results(records_frame(found, facts), facts).table, "a")
        for facts in (synthetic.facts(**grouped), synthetic.facts(**alone))
    )
    assert (wide["n"], wide["clusters"], wide["psnr_linear_median_db"]) == (6, 3, 2.25)
    assert wide["psnr_linear_db"] == narrow["psnr_linear_db"]
    assert wide["psnr_linear_lo_db"] < narrow["psnr_linear_lo_db"]
    assert narrow["clusters"] == 6


def test_cells_without_a_score_are_counted_and_are_in_no_mean():
    lost = rows({"t1": 0.0, "t2": 0.0}, label="b", state="unavailable", reason="needs a camera")
    failed = rows({"t1": 1.0}, state="failed", reason="no light")
    table = Results(records_frame([*lost, *failed, *rows({"t2": 2.0})], PLAIN), PLAIN).table
    assert (row_of(table, "a")["n"], row_of(table, "a")["failed"], row_of(table, "a")["psnr_linear_db"]) == (1, 1, 2.0)
    assert (row_of(table, "b")["n"], row_of(table, "b")["failed"]) == (0, 2)
    assert np.isnan(row_of(table, "b")["psnr_linear_db"])


def test_repeats_are_averaged_within_a_target_first():
    several = [*rows({"t1": 10.0}, repeats=3), *rows({"t2": 20.0})]
    row = row_of(Results(records_frame(several, PLAIN), PLAIN).table, "a")
    assert row["n"] == 2
    assert row["psnr_linear_db"] == pytest.approx((11.0 + 20.0) / 2)


def test_a_metric_that_some_targets_lack_has_no_mean():
    partial = rows({"t1": 10.0, "t2": 20.0})
    partial[0]["scores"] |= {"ssim_linear": 0.5, "speckle_contrast": 0.3}
    row = row_of(Results(records_frame(partial, PLAIN), PLAIN).table, "a")
    assert np.isnan(row["ssim_linear"])
    assert row["speckle_contrast"] == 0.3


def test_numbers_have_six_significant_digits_and_targets_the_order_of_the_dataset():
    frame = records_frame(rows({"t1": 12.3456789, "t2": 2.0}, seconds=1 / 3), PLAIN)
    assert list(frame["target"]) == ["t2", "t1"]
    text = csv_text(frame)
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
    table = Results(frame, PLAIN).table
    assert row_of(table, "a")["solving_s"] == 3.0
    assert row_of(table, "b")["solving_s"] == 4.0
    again = read_records(csv_text(frame))
    assert csv_text(Results(again, PLAIN).table) == csv_text(table)


def test_records_that_do_not_say_what_was_beside_them_have_no_column_for_it_and_all_their_seconds_count():
    old = [{key: value for key, value in record.items() if key != "alone"} for record in timed()]
    frame = records_frame(old, PLAIN)
    assert "timed_alone" not in frame
    assert row_of(Results(frame, PLAIN).table, "a")["solving_s"] == 4.0


@pytest.mark.parametrize("label", ["NA", "nan", "a,b", 'say "x"', "1e5", " padded ", "é"])
def test_labels_survive_being_written_and_read(label):
    facts = synthetic.facts(pairs=((label, "bench"),), targets=("t1",), reported={})
    text = csv_text(records_frame(rows({"t1": 1.0}, label=label), facts))
    assert list(read_records(text)["label"]) == [label]
    assert csv_text(read_records(text)) == text


def test_a_reason_with_line_breaks_stays_on_its_row_and_a_score_named_like_a_column_is_refused():
    frame = records_frame(rows({"t1": 1.0}, state="failed", reason="first\nsecond,\r\nthird"), PLAIN)
    read = pd.read_csv(io.StringIO(csv_text(frame)))
    assert list(read["reason"]) == ["first second, third"]
    bad = rows({"t1": 1.0})
    bad[0]["scores"]["captures"] = 1.0
    with pytest.raises(UserError, match="captures"):
        records_frame(bad, PLAIN)


def test_published_figures_have_columns_of_their_own_beside_the_display_they_belong_to(records):
    facts = synthetic.facts(beside="leto-aged")
    table = Results(records_frame(records, facts), facts).table
    assert row_of(table, "HIL")["reported_psnr_db"] == 20.5
    assert np.isnan(row_of(table, "GS")["reported_psnr_db"])
    assert row_of(table, "HIL")["psnr_linear_db"] != 20.5
    assert set(table[table["reported_psnr_db"].notna()]["condition"]) == {"leto-aged"}


def test_a_key_is_read_as_metric_domain_and_variant():
    score = parse("ms_ssim_amplitude")
    assert (score.metric, score.domain, score.variant) == ("ms_ssim", "amplitude", "")
    assert parse("psnr_linear_refined").variant == "refined"
    assert parse("speckle_contrast").domain == ""
    widths = {"psnr_linear_blur0.5": 0.5, "ssim_linear_blur1": 1.0, "psnr_linear": None}
    assert {key: parse(key).blur for key in widths} == widths


def test_distances_are_better_when_lower_and_similarities_when_higher():
    for key in ("mofd_srgb", "gmsd_srgb", "lpips_alex_srgb", "flip_srgb", "speckle_contrast"):
        assert parse(key).better(0.1, 0.2), key
    assert parse("psnr_linear").better(20.0, 17.0)
    assert parse("ssim_linear_blur1").better(0.6, 0.5)


def test_values_carry_unit_and_digits_of_their_metric():
    assert parse("psnr_linear").with_unit(17.618) == "17.62 dB"
    assert parse("psnr_linear").with_unit(1.2, signed=True) == "+1.20 dB"
    assert parse("ssim_linear").estimate(Estimate(0.4751, 0.41, 0.52, 8, 8)) == "0.475 [0.410, 0.520]"
    assert parse("ssim_linear").estimate(Estimate(0.4751, float("nan"), float("nan"), 2, 2)) == "0.475"
    assert parse("psnr_linear").number(float("nan")) == "–"
    assert parse("psnr_linear").number(-0.0001, signed=True) == "+0.00"


def test_plain_metrics_come_before_variants_and_descriptions():
    keys = ["efficiency", "psnr_linear_blur1", "ssim_linear", "psnr_srgb", "psnr_linear", "mofd_srgb"]
    ordered = order_scores(keys)
    assert ordered == ["psnr_linear", "psnr_srgb", "ssim_linear", "mofd_srgb", "psnr_linear_blur1", "efficiency"]
    assert order_scores(reversed(keys)) == ordered


CONFIG = """
title: Two methods
seed: 7
display: {profiles: [ideal, leto-aged], panel: [128, 128]}
targets: {dataset: "plugins.py:Gray", params: {count: 11}}
methods:
  - {name: "plugins.py:Toy", label: honest}
  - {name: "plugins.py:Following", label: knowing, profiles: [leto-aged]}
  - {name: "plugins.py:Seeing", label: seeing, profiles: [ideal], captures: 12, params: {value: 0.25}}
headline: ssim_linear
isolation: none
reported: {source: "a paper, table 3", rows: {honest: {psnr: 17.6}}}
"""


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    folder = tmp_path_factory.mktemp("study")
    (folder / "plugins.py").write_text(PLUGINS)
    (folder / "study.yaml").write_text(CONFIG)
    return load_study(folder / "study.yaml")


@pytest.fixture(scope="module")
def facts(study):
    return facts_of(study)


def test_facts_hold_what_the_config_orders(facts):
    assert facts.pairs == (("honest", "ideal"), ("honest", "leto-aged"), ("knowing", "leto-aged"), ("seeing", "ideal"))
    assert list(facts.targets.index) == [f"gray {number}" for number in range(11)]  # and not by the alphabet
    assert facts.methods["category"].to_dict() == {"honest": "open loop", "knowing": "oracle", "seeing": "online"}
    assert facts.published_metrics == ["psnr"]


def test_facts_know_how_each_cell_of_the_plan_is_made(study, facts):
    cells = [(label, one) for label, one in plan(study).labelled() if label in facts.methods.index]
    assert len(cells) == 44
    for label, one in cells:
        row = facts.row(label, one.profile, one.condition, one.target)
        assert facts.of(label, "params") == one.params
        assert row["capture_limit"] == one.captures or (one.captures is None and np.isnan(row["capture_limit"]))
        assert [row["panel_height_px"], row["panel_width_px"]] == list(one.panel)
        assert (row["study"], row["seed"]) == ("study", one.seed)
    assert facts.of("seeing", "params") == {"value": 0.25, "pause": 0.0, "fail": ""}


def test_clusters_are_those_of_the_dataset_and_rows_whose_network_is_the_ideal_image_are_known(tmp_path, facts):
    assert (facts.targets["cluster"] == facts.targets.index).all()
    assert facts.labels("identity") == set()
    (tmp_path / "plugins.py").write_text(PLUGINS)
    crops = "targets: {dataset: crops, params: {names: [astronaut], each: 2, renderings: 1}}"
    network = '{name: hil, label: "%s", params: {network: {name: %s}}}'
    methods = f"  - {network % ('none', 'identity')}\n  - {network % ('some', 'unet')}\n"
    config = CONFIG.replace("headline:", methods + "training: {dataset: dead_leaves}\nheadline:")
    (tmp_path / "study.yaml").write_text(re.sub("targets: .*", crops, config))
    changed = facts_of(load_study(tmp_path / "study.yaml"))
    clusters = {"astronaut-1": "astronaut", "astronaut-2": "astronaut", "still-life-1": "still-life"}
    assert changed.targets["cluster"].to_dict() == clusters
    assert changed.labels("identity") == {"none"}


def test_a_network_competes_by_whether_its_training_takes_photographs(tmp_path):
    (tmp_path / "plugins.py").write_text(PLUGINS)
    names = ("holonet", "ccnn", "tensor_holography", "unet_phase")
    nets = "".join(
        f"  - {{name: {name}, label: {name} {through}, params: {{through: {through}}}}}\n"
        for name in names
        for through in ("ideal", "parametric_model")
    )
    config = CONFIG.replace("headline:", nets + "  - hil\ntraining: {dataset: dead_leaves}\nheadline:")
    (tmp_path / "study.yaml").write_text(config)
    facts = facts_of(load_study(tmp_path / "study.yaml"))
    assert [facts.category(f"{name} ideal") for name in names] == ["open loop"] * 4
    assert [facts.category(f"{name} parametric_model") for name in names] == ["calibrated"] * 4
    assert facts.category("hil") == "calibrated"
    unseen = facts.methods[facts.methods["category"] != "online"]
    assert replace(facts, methods=unseen).spends
    assert not replace(facts, methods=unseen[unseen["blind"]]).spends


def test_displays_are_described_with_version_scaling_and_the_stages_that_differ_from_the_ideal(study):
    description = describe(study)
    assert description.config_file == "study.yaml"  # of a config outside the working folder, no folder
    ideal, aged = description.displays
    assert "Version 1, sha256 " in ideal.heading
    assert any("128 x 128" in line for line in ideal.lines)
    assert "stages with effects: sensor" in ideal.lines
    assert any(line.startswith("stages with effects: ") and "crosstalk" in line for line in aged.lines)


pytestmark = pytest.mark.usefixtures("no_physics")


def test_a_report_from_records_csv_has_the_same_bytes_but_for_pictures_which_are_small_copies(tmp_path: Path) -> None:
    methods = ("plugins.py:Toy", '{name: "plugins.py:Toy", label: "fails | a bit", params: {fail: "no <light>"}}')
    config, output = write_config(tmp_path, methods), tmp_path / "out"
    outcome, study = compute(config, output), load_study(config)
    build_report(study, outcome.records, output, outcome.provenance)
    shutil.rmtree(output / "records")
    before = files(output)
    assert "figures/answer-pictures.jpg" in before

    frame = read_records((output / "records.csv").read_text())
    assert difference(frame, plan(study)) == ""
    records = committed_records(frame, plan(study))
    for path in output.glob("figures/*.png"):
        path.unlink()
    build_report(study, records, output, outcome.provenance, keep_pictures=True)
    after = files(output)
    assert after.keys() == before.keys()
    assert after["details.md"].decode() == before["details.md"].decode()
    changed = [name for name in before if before[name] != after[name]]
    assert after["report.md"].decode() == before["report.md"].decode()
    assert sorted(changed) == ["figures/answer-pictures.jpg", "report.html"]  # which had the pictures of the records
    build_report(study, records, output, outcome.provenance, keep_pictures=True)
    assert files(output) == after


def test_other_cells_than_those_that_are_planned_are_counted(tmp_path: Path) -> None:
    config = write_config(tmp_path, count=2)
    outcome = compute(config, tmp_path / "out")
    study = load_study(config)
    build_report(study, outcome.records, tmp_path / "out", outcome.provenance)
    frame = read_records((tmp_path / "out" / "records.csv").read_text())
    config.write_text(config.read_text().replace("count: 2", "count: 1"))
    counted = difference(frame, plan(load_study(config)))
    lost, more = "6 of 6 planned cells are not in records.csv", "14 of 14 cells in records.csv are not planned"
    assert counted == f"{lost}, {more}"


@pytest.mark.parametrize(
    ("cells", "photographs"),
    [
        ([("a", "done", 100), ("a", "done", 90), ("b", "done", 100)], 195),  # repeats of a target are averaged
        ([("a", "done", 100), ("b", "failed", 3)], 103),
        ([("a", "done", 100), ("a", "failed", 4)], 100),  # not their mean
        ([("a", "failed", 4)], 4),
        ([("a", "missing", None)], None),
    ],
)
def test_photographs_of_failed_cells_count(cells, photographs):
    records = [
        synthetic.record(
            "a", synthetic.cell("a", target, "bench", repeat=place), {"psnr_linear": 1.0}, state=state, captures=taken
        )
        for place, (target, state, taken) in enumerate(cells)
    ]
    total = row_of(synthetic.results(records, baseline=None).table, "a")["total_captures"]
    assert total == photographs or (photographs is None and np.isnan(total))
