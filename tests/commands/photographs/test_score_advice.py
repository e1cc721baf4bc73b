"""What ``holoeval score`` and its report say of methods that lack targets, and of how to rank them."""

import numpy as np
import pytest

from holobench_eval.core.errors import CellError
from holobench_eval.imaging.align import PLAIN, align
from holobench_eval.report import Results, records_frame
from holobench_eval.report.stories import answer
from holobench_eval.report.stories.comparison import lacking
from holobench_eval.study.folders import FILES
from holobench_eval.study.folders.pairing import UNKNOWN
from tests.support.synthetic_study import cell, facts, record, study


def test_a_way_to_a_ranking_is_told_where_no_method_has_every_target(tmp_path):
    records, given = study(tmp_path, size=24), facts(measure=FILES)
    one = lacking(Results(records_frame(records, given), given))  # GS lacks coffee on a display
    assert one.startswith("Only the 11 rows that have every target are ranked: GS on leto-aged lacks 1 of 6 targets")
    first = records[0]["cell"]["target"]
    lost = {"state": "failed", "scores": {}, "reason": "cannot be aligned"}
    holed = [{**one, **lost} if one["cell"]["target"] == first else one for one in records]
    results = Results(records_frame(holed, given), given)
    assert f"move the targets and captures of {first}" in lacking(results)
    nothing = [{**one, **lost} for one in records]
    assert lacking(Results(records_frame(nothing, given), given)).endswith("or name them by what they show.")


def holed(*holes: tuple[str, str, str, str]) -> Results:
    """Methods a to c with scores of four targets, but for holes: state, method, target, reason."""
    targets = ("t0", "t1", "t2", "t3")
    pairs, alone = tuple((m, "d") for m in "abc"), {"privileged": (), "reported": {}, "baseline": None}
    given = facts(pairs=pairs, targets=targets, measure=FILES, values="linear", **alone)
    lost = {(method, target): {"state": state, "reason": reason} for state, method, target, reason in holes}
    records = [
        one | lost.get((method, target), {}) | ({"scores": {}} if (method, target) in lost else {})
        for value, method in enumerate("abc")
        for target in targets
        for one in [record(method, cell(method, target, "d"), {"psnr_linear": 20.0 + value})]
    ]
    return Results(records_frame(records, given), given)


def test_methods_that_lack_targets_are_told_though_others_are_complete():
    results = holed(("missing", "c", "t1", "no capture"), ("missing", "b", "t1", "no"), ("missing", "c", "t3", "no"))
    said = lacking(results)
    assert "b lacks 1 of 4 targets (t1), c lacks 2 of 4 targets (t1, t3). Add the captures that are missing" in said
    few, *verdicts = answer(results)
    assert few.startswith("No difference can be shown: 4 targets")
    assert verdicts == ["Best: a, 20.00 dB.", said]  # though the mean of c is higher
    assert lacking(holed()) == ""


def test_a_method_without_any_score_does_not_stand_in_the_way_of_a_ranking_of_the_others():
    nothing = [("failed", "c", f"t{index}", "too faint") for index in range(4)]
    said = lacking(holed(*nothing, ("failed", "b", "t0", "too faint")))
    assert "c lacks all 4 targets" in said
    assert "rank all that have any score by the 3 targets left" in said
    _, best, lack = answer(holed(*nothing))
    assert "c" not in best.split()
    assert "c lacks all 4 targets" in lack


@pytest.mark.parametrize(
    "reason",
    [
        f"CellError: the capture is gray and the target is in colour: {UNKNOWN}",
        "CellError: the target has structure in 2 of its 9 parts only, too little to find it by",
        "CellError: the target is found in the capture (correlation 0.80), but it takes 9 capture pixels for each of "
        "its own; 0.2 to 8 are allowed: resize the target",
    ],
)
def test_nobody_takes_a_capture_again_for_a_fault_of_its_target_or_its_file(reason):
    said = lacking(holed(*(("failed", method, "t1", reason) for method in "abc")))
    assert "Save or choose the target t1 anew, whose fault it is and not the captures'" in said
    assert "again" not in said
    in_file = "CellError: the target is gray and the capture nearly so; save the capture in gray"
    both = lacking(holed(("failed", "a", "t1", reason), ("failed", "b", "t2", in_file), ("failed", "c", "t3", "faint")))
    assert "save b/t2 anew, as the reasons say; take the failed captures again" in both


def test_the_reasons_that_blame_a_target_are_those_that_are_given():
    for plain in (np.full((1, 64, 64), 0.5), np.tile(np.sin(np.arange(96)) / 2 + 0.5, (1, 96, 1))):
        with pytest.raises(CellError, match=PLAIN):
            align(np.pad(plain, ((0, 0), (9, 9), (9, 9))), plain)
