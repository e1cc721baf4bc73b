"""Numbers are those of table.csv; scores compare within groups alone."""

from __future__ import annotations

import csv
import math
from pathlib import Path
from typing import Any

import pytest

from holobench_eval.report.site.intake import Source, read
from holobench_eval.report.site.standing import CURRENT, OLDER, UNRECORDED, Group, groups
from tests.support.results_folder import write_results

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
                (row.table["seconds"], "solving_s"),
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
    assert group.baseline is not None
    theirs = next(row for row in group.rows if row.label == HOSTILE)
    ours = next(row for row in group.rows if row.label == "HIL")
    assert theirs.score.mean == pytest.approx(ours.score.mean + 1)
    assert theirs.gain is not None
    assert ours.gain is not None
    assert theirs.gain.mean == pytest.approx(ours.gain.mean + 1)


def test_ranks_are_within_a_category_and_holes_and_oracles_have_none(found: list[Group]) -> None:
    rows = of(found, "leto-aged").rows
    ranks = {(row.label, row.source.by): row.rank for row in rows}
    assert [row.rank for row in rows if row.category == "ceiling"] == [None, None]
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
    assert all([source.name for source in row.also] == ["again"] for row in rows)


def test_a_profile_of_the_package_with_another_digest_is_a_display_of_its_own(
    site: Site, study: Records, tmp_path: Path
) -> None:
    known = {"profiles": {name: {"version": 1, "sha256": OTHER} for name in ("leto-aged", "ideal")}}
    other = write_results(tmp_path / "theirs", study, by="Lab", known=known)
    titles = {group.display.title for group in groups([taken(site.own), taken(other)])}
    assert titles == {"leto-aged", "ideal", "leto-aged (other 22222222)", "ideal (other 22222222)"}


def test_versions_are_told_apart(study: Records, tmp_path: Path) -> None:
    versions = {}
    for name, harness in (("new", {}), ("old", {"harness": "3: of old"}), ("unknown", {"harness": ""})):
        folder = write_results(tmp_path / name, study, known=harness)
        versions[name] = {group.version for group in groups([taken(folder)])}
    assert versions == {"new": {CURRENT}, "old": {OLDER}, "unknown": {UNRECORDED}}


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
    label, score = ("label", "psnr_linear_db") if "label" in lines[0] else ("method", "psnr_linear")
    expected = {(line[label], line["condition"]): line[score] for line in lines if line["condition"] != "reference"}
    found = {
        (row.label, group.display.name): f"{row.score.mean:.6g}"
        for group in groups([taken(folder)])
        for row in group.rows
    }
    assert found == expected
