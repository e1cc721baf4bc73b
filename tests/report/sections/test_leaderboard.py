import pytest

from holobench_eval.report import Results, csv_text, recompute_files, records_frame
from holobench_eval.report.data.categories import meanings
from holobench_eval.report.sections.display.findings import findings
from holobench_eval.report.sections.leaderboard import leaderboard, reading
from holobench_eval.report.sections.results import stopped
from holobench_eval.study.plan import REFERENCE
from tests.support import budget_study as budget
from tests.support import synthetic_study as synthetic


def results(records, **changes):
    layout = budget.layout(**changes)
    return Results(records_frame(records, layout), layout)


@pytest.fixture(scope="module")
def records():
    return budget.study()


@pytest.fixture(scope="module")
def found(records):
    return results(records)


def rows(text):
    header, _, *body = [[cell.strip() for cell in line.strip("|").split("|")] for line in str(text).splitlines()]
    return [dict(zip(header, row, strict=True)) for row in body]


def ranked(found, condition="leto-aged"):
    return [(row["track"], row["rank"], row["method"]) for row in rows(leaderboard(found, condition))]


def test_ranks_are_counted_anew_in_every_track_and_the_ceiling_has_none(found):
    order = ranked(found)
    assert [row[:2] for row in order] == [
        *(("open loop", str(rank)) for rank in range(1, 5)),
        *(("calibrated", str(rank)) for rank in range(1, 5)),
        *(("online", str(rank)) for rank in range(1, 4)),
        ("ceiling", "–"),
    ]
    assert order[4][2] == "parametric_model (64 captures)"
    assert order[8][2] == "online_camera_network"


def test_total_captures_are_those_of_the_training_and_of_every_target(found):
    total = found.table.set_index(["label", "condition"])["total_captures"]
    assert total["online_camera_network", "ideal"] == 64 + 50 * len(budget.TARGETS)
    assert total["online_camera (25 captures)", "ideal"] == 25 * len(budget.TARGETS)
    assert total["parametric_model (64 captures)", "ideal"] == 64
    assert total["wirtinger", "ideal"] == 0


def test_repeats_are_one_hologram_measured_again_and_do_not_add_captures(records):
    again = [record | {"cell": record["cell"] | {"repeat": 1}} for record in records]
    total = results([*records, *again]).table.set_index(["label", "condition"])["total_captures"]
    assert total["online_camera_network", "ideal"] == 64 + 50 * len(budget.TARGETS)


def test_a_method_that_lacks_a_target_is_in_its_track_without_a_rank(records):
    lost = next(i for i, r in enumerate(records) if r["label"] == "wirtinger" and r["cell"]["condition"] == "leto-aged")
    holed = [*records[:lost], records[lost] | {"state": "failed", "scores": {}}, *records[lost + 1 :]]
    order = ranked(results(holed))
    assert order[:4][-1] == ("open loop", "–", "wirtinger")
    assert [rank for track, rank, _ in order if track == "open loop"] == ["1", "2", "3", "–"]


def test_a_headline_of_which_less_is_better_is_ranked_the_other_way(records):
    turned = [record | {"scores": {"mofd_srgb": record["scores"]["psnr_linear"]}} for record in records]
    order = [name for track, _, name in ranked(results(turned, headline="mofd_srgb")) if track == "calibrated"]
    assert order == [name for track, _, name in ranked(results(records)) if track == "calibrated"][::-1]


def test_no_gap_is_closed_at_the_baseline_and_all_of_it_at_the_oracle(found):
    for name, share in (("wirtinger", 0), ("oracle", 1)):
        closed = found.gap_closed(name, "ideal")
        assert (closed.low, closed.mean, closed.high) == pytest.approx((share, share, share))
    mean = {name: found.values(name, "ideal").mean() for name in ("wirtinger", "hil", "oracle")}
    expected = (mean["hil"] - mean["wirtinger"]) / (mean["oracle"] - mean["wirtinger"])
    closed = found.gap_closed("hil", "ideal")
    assert closed.mean == pytest.approx(expected)
    assert closed.low < expected < closed.high


def test_there_is_no_gap_to_an_oracle_below_the_baseline(records):
    bad = [r | {"scores": {"psnr_linear": 1.0}} if r["label"] == "oracle" else r for r in records]
    assert results(bad).gap_closed("hil", "ideal") is None
    assert "way to the ceiling" not in leaderboard(results(bad), "ideal")


def test_memory_is_the_median_since_a_first_solution_also_loads_libraries(records):
    heavy = [r | {"memory_mib": 900.0} if r["cell"]["target"] == budget.TARGETS[0] else r for r in records]
    memory = results(heavy).table.set_index(["label", "condition"])["memory_mib"]
    assert memory["wirtinger", "ideal"] == 10


def test_a_stopped_method_is_named_with_its_reason_and_how_often(records):
    reason = "online_camera has used its 25 captures"
    ended = [r | {"stopped": reason} if "(25" in r["label"] and r["cell"]["target"] != "coffee" else r for r in records]
    (line,) = stopped(results(ended), "ideal")
    assert line.startswith(f"The display stopped online_camera (25 captures) on 5 of 6 targets: {reason}.")
    assert stopped(results(records), "ideal") == []


def test_the_findings_rank_online_methods_apart(found):
    ((_, sentences), *_) = findings(found)
    best = "parametric_model (64 captures)"
    assert sentences[0].startswith(f"{best} ranks first of 8 methods, without the camera for the scored image: PSNR")
    assert "ranks first of 3 methods of the online track, with the camera for the scored image: PSNR" in sentences[1]
    assert any(f"{best}, the best method of the calibrated track, closes 7" in sentence for sentence in sentences)
    assert not any("online" in label for label in found.ranking("leto-aged"))


def test_tracks_are_explained_where_they_occur(records, found):
    assert [category for category, _ in meanings(found.categories)] == ["open loop", "calibrated", "online", "ceiling"]
    assert "compete in a track of their own" in reading(found)
    kept = [record for record in records if not record["label"].startswith("online")]
    pairs = tuple(pair for pair in budget.layout().pairs if not pair[0].startswith("online"))
    without = results(kept, pairs=pairs, camera=frozenset())
    assert "online" not in without.categories
    assert "track of their own" not in reading(without)


def test_a_study_without_captures_has_no_leaderboard(records):
    plain = [record for record in records if record["label"] in ("wirtinger", "sgd")]
    pairs = tuple((label, "ideal") for label in ("wirtinger", "sgd"))
    assert not leaderboard(results(plain, pairs=pairs, camera=frozenset(), trained=frozenset()), "ideal")


def test_the_table_follows_from_the_written_records(records):
    ended = [record | {"stopped": "over, and out"} for record in records]
    floor = synthetic.record("floor_black", synthetic.cell("floor_black", "coffee", REFERENCE), {"psnr_linear": 1.0})
    found = results([*ended, floor])
    written = csv_text(found.frame)
    assert recompute_files(written, found.layout)["table.csv"] == csv_text(found.table)


def test_a_study_in_which_no_memory_was_measured_has_no_column_for_it(records):
    found = results([record | {"memory_mib": None} for record in records])
    assert "memory_mib" not in found.frame
    assert "memory" not in leaderboard(found, "ideal")
