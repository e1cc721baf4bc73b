"""Numbers are those of table.csv; scores compare within groups alone."""

from __future__ import annotations

import csv
import math
import re
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from holobench_eval.report.site.board import Names, board
from holobench_eval.report.site.intake import Source, read
from holobench_eval.report.site.standing import ANOTHER, CURRENT, UNRECORDED, Group, groups
from holobench_eval.study.versions import HARNESS
from tests.support.results_folder import TARGETS, write_results

from .conftest import HOSTILE, OTHER, Site, of_others


def taken(folder: Path) -> Source:
    """A folder whose place makes it own, unless it says whose it is."""
    return read(folder, folder)


Records = list[dict[str, Any]]


@pytest.fixture(scope="module")
def found(site: Site) -> list[Group]:
    return groups([taken(site.own), taken(site.other)])


def of(found: list[Group], display: str) -> Group:
    return next(group for group in found if group.display.name == display)


def test_means_and_intervals_are_those_of_table_csv(site: Site) -> None:
    with (site.own / "table.csv").open(newline="") as file:
        expected = {(row["label"], row["condition"]): row for row in csv.DictReader(file)}
    compared = 0
    for group in groups([taken(site.own)]):
        for row in group.rows:
            line = expected[row.label, group.display.name]
            for value, name in (
                (row.score.mean, "psnr_linear_db"),
                (row.score.low, "psnr_linear_lo_db"),
                (row.score.high, "psnr_linear_hi_db"),
                (row.table["solving_s"], "solving_s"),
            ):
                assert f"{value:.6g}" == line[name]
                compared += 1
            assert (len(row.values), row.failed) == (int(line["n"]), int(line["failed"]))
    assert compared == 4 * 12


def test_differences_are_those_of_tests_csv(site: Site) -> None:
    with (site.own / "tests.csv").open(newline="") as file:
        expected = {(row["label"], row["condition"]): row for row in csv.DictReader(file)}
    gains = [(row, group) for group in groups([taken(site.own)]) for row in group.rows if row.gain]
    assert len(gains) == 9  # of 12 rows, without the baselines and the row with a hole
    for row, group in gains:
        assert row.gain is not None
        line = expected[row.label, group.display.name]
        for value, name in ((row.gain.mean, "difference_db"), (row.gain.low, "difference_lo_db")):
            assert value == pytest.approx(float(line[name]), rel=1e-5)


def test_the_same_targets_display_and_harness_are_one_group_across_folders(found: list[Group]) -> None:
    assert {group.display.name for group in found} == {"leto-aged", "ideal"}
    assert len(found) == 2
    group = of(found, "ideal")
    assert {row.source.by for row in group.rows} == {"", "<i>Their</i> lab"}
    assert group.baselines == ("Wirtinger",)
    theirs = next(row for row in group.rows if row.label == HOSTILE)
    ours = next(row for row in group.rows if row.label == "HIL")
    assert theirs.score.mean == pytest.approx(ours.score.mean + 1)
    assert theirs.gain is not None
    assert ours.gain is not None
    assert theirs.gain.mean == pytest.approx(ours.gain.mean + 1)


def test_ranks_are_within_a_category_and_holes_and_oracles_have_none(found: list[Group]) -> None:
    rows = of(found, "leto-aged").rows
    ranks = {(row.label, row.source.by): row.rank for row in rows}
    assert [row.rank for row in rows if row.category == "oracle"] == [None, None]
    holes = [row for row in rows if row.label == "GS"]
    assert [(row.rank, row.failed, len(row.values), row.gain) for row in holes] == [(None, 1, 3, None)] * 2
    for row in rows:
        rivals = [other for other in rows if other.rank is not None and other.category == row.category]
        if row.rank is not None:
            better = sum(other.score.mean > row.score.mean for other in rivals)
            assert ranks[row.label, row.source.by] == 1 + better


@pytest.mark.parametrize(
    "change",
    [
        {"known": {"harness": "another"}},
        {"known": {"profiles": {name: {"version": 1, "sha256": OTHER} for name in ("leto-aged", "ideal")}}},
        {"exposure": "matched"},
        {"protocol": "v2"},
        {"targets": 3},
        {"cluster": "one"},
        {"floor": 0.1},
        {"floor": None},
    ],
    ids=lambda change: str(next(iter(change))),
)
def test_what_differs_in_anything_that_matters_is_another_group(
    site: Site, study: Records, tmp_path: Path, change: dict[str, Any]
) -> None:
    records = [dict(record) for record in of_others(study)]
    for record in records:
        record["cell"] = {**record["cell"], **{k: v for k, v in change.items() if k in ("exposure", "protocol")}}
        if record["label"] == "floor_constant" and change.get("floor"):
            record["scores"] = {**record["scores"], "psnr_linear": record["scores"]["psnr_linear"] + change["floor"]}
    if change.get("targets"):
        records = [record for record in records if record["cell"]["target"] != "rocket"]
    if "floor" in change and change["floor"] is None:
        records = [record for record in records if not record["label"].startswith("floor")]
    other = write_results(tmp_path / "theirs", records, by="Lab", known=change.get("known"))
    if "cluster" in change:
        text = (other / "records.csv").read_text().replace(",astronaut,astronaut,", ",astronaut,coffee,")
        (other / "records.csv").write_text(text)
    found = groups([taken(site.own), taken(other)])
    assert len(found) == 4
    assert all(len({row.source.by for row in group.rows}) == 1 for group in found)


def test_a_floor_that_differs_by_rounding_alone_is_the_same_group(site: Site, study: Records, tmp_path: Path) -> None:
    records = [
        record | {"scores": {**record["scores"], "psnr_linear": record["scores"]["psnr_linear"] + 0.001}}
        for record in of_others(study)
        if record["scores"]
    ]
    other = write_results(tmp_path / "theirs", records, by="Lab")
    assert len(groups([taken(site.own), taken(other)])) == 2


def test_the_very_same_cells_in_two_studies_are_one_row(site: Site, study: Records, tmp_path: Path) -> None:
    again = write_results(tmp_path / "again", study)
    rows = of(groups([taken(site.own), taken(again)]), "ideal").rows
    assert len(rows) == 6
    assert all({source.name for source in row.sources} == {"again", "ours"} for row in rows)


def test_a_copy_by_others_is_no_row_of_its_own_and_shows_whose_it_is(
    site: Site, study: Records, tmp_path: Path
) -> None:
    copy = write_results(tmp_path / "copy", study, by="Lab")
    rows = of(groups([taken(copy), taken(site.own)]), "ideal").rows
    assert [row.whose for row in rows] == ["own, Lab"] * 6


def test_ranks_count_methods_with_their_parameters_and_not_their_runs(
    site: Site, study: Records, tmp_path: Path
) -> None:
    again = write_results(tmp_path / "another", [r | {"cell": {**r["cell"], "seed": 5}} for r in study], by="Lab")
    labels = dict.fromkeys(record["label"] for record in study)
    pd.DataFrame({"label": list(labels), "parameters": '{"seed": 5}'}).to_csv(again / "table.csv", index=False)
    alone, both = of(groups([taken(site.own)]), "ideal"), of(groups([taken(again), taken(site.own)]), "ideal")
    assert both.ranked == alone.ranked
    own = {row.label: row.rank for row in both.rows if not row.source.by}
    assert own == {row.label: row.rank for row in alone.rows}
    theirs = [row for row in both.rows if row.source.by and row.category != "oracle"]
    assert theirs
    assert all(row.rank is None and row.is_further for row in theirs)


def worse(records: Records, label: str, by: float) -> Records:
    """Records of other runs, in which one method is worse."""
    changed = []
    for record in of_others(records):
        loss = by if record["label"] == label else 0.0
        scores = {key: value - loss * (key == "psnr_linear") for key, value in record["scores"].items()}
        changed.append(record | {"scores": scores})
    return changed


def test_no_folder_sets_the_baseline_of_another(site: Site, study: Records, tmp_path: Path) -> None:
    other = write_results(tmp_path / "theirs", worse(study, "Wirtinger", 6.0), by="Lab")
    alone = {row.label: row.gain for row in of(groups([taken(site.own)]), "ideal").rows}
    for order in ((site.own, other), (other, site.own)):
        rows = of(groups([taken(folder) for folder in order]), "ideal").rows
        assert {row.label: row.gain for row in rows if not row.source.by} == alone
        theirs = {row.label: row.gain for row in rows if row.source.by}
        ours, lab = alone["SGD"], theirs["SGD"]
        assert ours is not None
        assert lab is not None
        assert lab.mean == pytest.approx(ours.mean + 6.0)


def test_targets_are_the_same_images_only_where_every_one_has_a_constant_image(study: Records, tmp_path: Path) -> None:
    few = [r for r in study if r["label"] != "floor_constant" or r["cell"]["target"] == TARGETS[0]]
    folders = [write_results(tmp_path / name, few, by=name) for name in ("Lab A", "Lab B")]
    found = groups([taken(folder) for folder in folders])
    assert len(found) == 4
    assert all(len({row.source.by for row in group.rows}) == 1 for group in found)


def as_files(folder: Path) -> Path:
    """Make a folder one of photographs that were given as files."""
    frame = pd.read_csv(folder / "records.csv", dtype=str, keep_default_na=False)
    frame = frame[frame["condition"].isin(["reference", "ideal"])]
    frame["measure"], frame["condition"] = "files", frame["condition"].replace("ideal", "bench")
    frame["display"] = frame["condition"]
    frame.to_csv(folder / "records.csv", index=False)
    return folder


def test_photographs_of_two_labs_in_folders_of_one_name_are_two_displays(study: Records, tmp_path: Path) -> None:
    known = {"files": {}, "profiles": {}, "code_sha256": {"metrics": HARNESS}}
    folders = [
        as_files(write_results(tmp_path / name / "results", study, by=name, known=known)) for name in ("Lab A", "Lab B")
    ]
    found = groups([taken(folder) for folder in folders])
    assert len({group.display.title for group in found}) == len(found) == 2
    assert all(len({row.source.by for row in group.rows}) == 1 for group in found)


def in_another_metric(folder: Path) -> Path:
    """Make a folder one of a headline whose lower values are better."""
    frame = pd.read_csv(folder / "records.csv", dtype=str, keep_default_na=False).rename(
        columns={"psnr_linear_db": "flip_srgb"}
    )
    frame["flip_srgb"] = [f"{float(value) / 100:.4f}" if value else "" for value in frame["flip_srgb"]]
    frame.to_csv(folder / "records.csv", index=False)
    tests = pd.read_csv(folder / "tests.csv", dtype=str, keep_default_na=False)
    tests.assign(metric="flip_srgb").to_csv(folder / "tests.csv", index=False)
    return folder


def test_a_metric_whose_lower_values_are_better_sorts_by_what_is_better(study: Records, tmp_path: Path) -> None:
    found = groups([taken(in_another_metric(write_results(tmp_path / "theirs", study, by="Lab")))])
    rows = of(found, "ideal").rows
    assert [row.score.mean for row in rows] == sorted(row.score.mean for row in rows)
    page = str(board([of(found, "ideal")], Names({str(tmp_path / "theirs"): "theirs"})))
    for key in ("score", "gain", "above"):
        numbers = [float(value) for value in re.findall(rf'data-{key}="([^"]+)"', page)]
        assert len(numbers) > 3
        assert numbers == sorted(numbers, reverse=True)


def test_a_profile_of_the_package_with_another_digest_is_a_display_of_its_own(
    site: Site, study: Records, tmp_path: Path
) -> None:
    known = {"profiles": {name: {"version": 1, "sha256": OTHER} for name in ("leto-aged", "ideal")}}
    other = write_results(tmp_path / "theirs", study, by="Lab", known=known)
    found = groups([taken(site.own), taken(other)])
    assert {(group.display.is_other, group.version) for group in found} == {(False, CURRENT), (True, ANOTHER)}
    titles = {group.display.title for group in found}
    assert titles == {"leto-aged", "ideal", "leto-aged (other 22222222)", "ideal (other 22222222)"}


def test_versions_are_told_apart(study: Records, tmp_path: Path) -> None:
    versions = {}
    for name, harness in (("new", {}), ("old", {"harness": "3: of old"}), ("unknown", {"harness": ""})):
        folder = write_results(tmp_path / name, study, known=harness)
        versions[name] = {group.version for group in groups([taken(folder)])}
    assert versions == {"new": {CURRENT}, "old": {ANOTHER}, "unknown": {UNRECORDED}}


def test_a_score_above_the_constant_image_is_paired(found: list[Group]) -> None:
    for group in found:
        for row in group.rows:
            assert row.above is not None
            assert row.above.n == len(row.values)
            assert math.isfinite(row.above.low)


@pytest.mark.parametrize("name", ["table3", "table1", "budget"])
def test_means_of_committed_reports_are_those_of_their_tables(name: str) -> None:
    folder = Path(__file__).parents[3] / "reports" / name
    with (folder / "table.csv").open(newline="") as file:
        lines = list(csv.DictReader(file))
    shown = [line for line in lines if line["condition"] != "reference"]
    expected = {(line["label"], line["condition"]): line["psnr_linear_db"] for line in shown}
    found = {
        (row.label, group.display.name): f"{row.score.mean:.6g}"
        for group in groups([taken(folder)])
        for row in group.rows
    }
    assert found == expected


def test_ms_ssim_stands_beside_psnr_and_who_is_first_by_it_is_named(study: Records, tmp_path: Path) -> None:
    ms_ssim = {"Double phase": 0.9, "Wirtinger": 0.5}
    records = [r | {"scores": r["scores"] | {"ms_ssim_linear": ms_ssim.get(r["label"], 0.4)}} for r in study]
    group = of(groups([taken(write_results(tmp_path / "theirs", records))]), "ideal")
    page = str(board([group], Names({str(tmp_path / "theirs"): "theirs"})))
    assert "by MS-SSIM first: Double phase (" in page
    assert '<td class="within">0.500</td>' in page
