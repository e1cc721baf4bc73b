"""Rankings over draws of a display: made-up studies in which it is known what flips, and why."""

import math
from collections.abc import Callable, Mapping
from importlib.resources import files

import numpy as np
import pytest
from scipy import stats
from skimage.io import imread

from holobench_eval.display import load_profile
from holobench_eval.display.simulated.changes import draws
from holobench_eval.report import Layout, Results, layout_of, records_frame, write_report
from holobench_eval.report.facts import Swept
from holobench_eval.report.data.ranks import ranks, share
from holobench_eval.report.description import Description
from holobench_eval.report.sections import ranks as section_ranks
from holobench_eval.study.config import load_study
from tests.support import synthetic_study as synthetic
from tests.support.reports import whole

Quality = Callable[[Mapping[str, float]], float]

DISPLAY, COUNT, TARGETS = "leto-aged", 30, synthetic.TARGETS[:3]
LEVELS = dict(zip(TARGETS, (-2.0, 0.5, 1.5), strict=True))
PROFILE = load_profile(DISPLAY)
NOMINAL = {"crosstalk": 0.45, "zero_phase": -0.5, "astigmatism": 0.05, "gamma": 1.28}
MIDDLE = 0.35
"""Of the range of crosstalk."""


def study(methods: Mapping[str, Quality], count: int = COUNT, **changes):
    """Records and layout; methods: mean quality [dB] from a draw's parameters."""
    drawn = tuple(draws.values(PROFILE, index) for index in range(1, count + 1))
    conditions = {DISPLAY: NOMINAL} | {f"{DISPLAY}, draw {i}": values for i, values in enumerate(drawn, start=1)}
    records = [
        synthetic.record(
            label,
            synthetic.cell("sgd", target, condition, params={"label": label}),
            {"psnr_linear": quality(values) + level},
        )
        for label, quality in methods.items()
        for condition, values in conditions.items()
        for target, level in LEVELS.items()
    ]
    points = tuple((str(i), condition) for i, condition in enumerate(list(conditions)[1:], start=1))
    given = {
        "title": "Made-up draws",
        "pairs": tuple((label, condition) for label in methods for condition in conditions),
        "targets": TARGETS,
        "baseline": next(iter(methods)),
        "sweeps": (Swept("draw", DISPLAY, points, drawn),),
    }
    return records, Layout(**(given | changes))


def found(methods, lost=(), **changes):
    """The ranking; lost: (label, draw, target) without a score, None for any."""
    records, layout = study(methods, **changes)
    for record in records:
        place = (record["label"], record["cell"]["condition"].rpartition("draw ")[2], record["cell"]["target"])
        if any(all(a in (None, b) for a, b in zip(one, place, strict=True)) for one in lost):
            record |= {"state": "failed", "scores": {}}
    (one,) = ranks(Results(records_frame(records, layout), layout))
    return one


FLIPPING: Mapping[str, Quality] = {
    "steady": lambda values: 20.0,
    "robust": lambda values: 20.0 + 10 * (values["crosstalk"] - MIDDLE),
    "poor": lambda values: 12.0,
}


def test_a_method_that_wins_above_the_middle_of_a_parameter_flips_there_and_the_parameter_is_named():
    one = found(FLIPPING)
    high = np.array([values["crosstalk"] > MIDDLE for values in one.swept.drawn])
    assert 5 < high.sum() < 25
    assert one.methods == ["robust", "steady", "poor"]  # nominal crosstalk is high
    assert one.first("robust").mean == pytest.approx(high.mean())
    assert one.first("steady").mean == pytest.approx(1 - high.mean())
    assert one.first("poor").mean == 0
    pair = one.pairs[0]
    assert (pair.first, pair.second, pair.flips) == ("robust", "steady", (~high).sum())
    assert pair.nominal == pytest.approx(1.0)
    cause = one.cause(pair)
    assert cause.parameter == "crosstalk"
    assert (cause.rho, cause.explained) == pytest.approx((1, 1))
    assert [p.flips for p in one.pairs[1:]] == [0, 0]
    assert one.positions.tolist() == [[1, 2, 3] if up else [2, 1, 3] for up in high]
    assert one.taus == pytest.approx(np.where(high, 1.0, 1 / 3))
    assert one.tau.low < one.taus.mean() < one.tau.high
    assert one.shares.sum(axis=1) == pytest.approx(1)


def test_lower_is_better_turns_the_ranking_and_not_the_meaning_of_a_lead():
    records, layout = study(FLIPPING, headline="mofd_srgb")
    for record in records:
        record["scores"] = {"mofd_srgb": record["scores"]["psnr_linear"]}
    (one,) = ranks(Results(records_frame(records, layout), layout))
    assert one.methods == ["poor", "steady", "robust"]
    pair = one.pairs[-1]
    assert (pair.first, pair.second) == ("steady", "robust")
    assert pair.nominal == pytest.approx(1.0)
    assert one.cause(pair).rho > 0  # more crosstalk raises the score of robust, which is worse


def test_methods_that_are_far_apart_never_flip():
    one = found({"best": lambda v: 25.0 - v["crosstalk"], "middle": lambda v: 20.0, "last": lambda v: 15.0})
    assert (one.taus == 1).all()
    assert (one.tau.low, one.tau.mean, one.tau.high) == (1, 1, 1)
    assert [pair.flips for pair in one.pairs] == [0, 0, 0]
    assert section_ranks.flips(one) is None


def test_ties_share_the_first_place_flip_nothing_and_have_no_tau(tmp_path):
    one = found({"a": lambda v: 20.0, "b": lambda v: 20.0})
    assert (one.positions == 1).all()
    assert one.first("a").mean == one.first("b").mean == 1
    assert one.pairs[0].flips == 0
    assert len(one.taus) == 0
    assert list(section_ranks.draw([one], tmp_path)) == []


def test_a_difference_that_no_parameter_explains_is_said_to_have_none():
    one = found({"a": lambda v: 20.0 + math.sin(1e6 * v["gamma"]), "b": lambda v: 20.0})
    assert 0 < one.pairs[0].flips < COUNT
    assert one.cause(one.pairs[0]) is None
    assert "nothing drawn" in section_ranks.flips(one)
    few = found(FLIPPING, count=4)  # which explain nothing, however well they are ordered
    assert few.pairs[0].flips
    assert few.cause(few.pairs[0]) is None


def test_an_angle_is_told_by_its_sine_and_cosine_and_a_signed_range_by_its_size_too():
    turned = found({"a": lambda v: 20.0 + math.cos(v["zero_phase"]), "b": lambda v: 20.0})
    assert turned.cause(turned.pairs[0]).parameter.startswith("cosine of the phase of the unmod")
    bent = found({"a": lambda v: 20.0, "b": lambda v: 19.0 + 15 * abs(v["astigmatism"])})
    assert bent.pairs[0].flips
    assert bent.cause(bent.pairs[0]).parameter == "size of the astigmatism"
    assert len([words for words in bent.features if "phase of the unmod" in words]) == 2


LACKS = "a ranked method lacks a target there (see Holes), as every method does where the camera cannot be registered."


def test_a_hole_takes_its_draw_from_all_methods_and_is_told():
    one, whole = found(FLIPPING, lost=[("poor", "7", TARGETS[1])]), found(FLIPPING)
    assert one.methods == whole.methods
    assert one.used == [index for index in range(COUNT) if index != 6]
    assert (one.drawn == np.delete(whole.drawn, 6, axis=0)).all()
    assert {len(values) for values in one.features.values()} == {COUNT - 1}
    (sentence,) = section_ranks.left_out(one)
    assert sentence == f"Draw 7 is left out (1 of 30): {LACKS}"


def test_benches_on_which_nothing_could_be_scored_are_left_out(tmp_path):
    one = found(FLIPPING, lost=[(None, "3", None), (None, "9", None)])
    (sentence,) = section_ranks.left_out(one)
    assert sentence == f"Draws 3 and 9 are left out (2 of 30): {LACKS}"
    none = found(FLIPPING, lost=[(None, str(index), None) for index in range(1, COUNT + 1)])
    assert not none.exists
    assert list(section_ranks.draw([none], tmp_path)) == []


def test_a_method_that_mostly_fails_is_not_ranked_and_takes_no_draws_from_the_others():
    one = found(FLIPPING, lost=[("poor", str(index), None) for index in range(1, 20)])
    assert one.methods == ["robust", "steady"]
    assert len(one.used) == COUNT
    assert "Not ranked" in section_ranks.left_out(one)[0]
    assert "poor" in section_ranks.left_out(one)[0]


def test_oracles_and_methods_that_see_the_camera_are_not_ranked():
    one = found(FLIPPING, privileged=frozenset({"robust"}), camera=frozenset({"poor"}))
    assert one.methods == ["steady"]
    assert not one.exists


def test_a_share_has_wilsons_interval():
    some, expected = share(15, 40), stats.binomtest(15, 40).proportion_ci(method="wilson")
    assert (some.low, some.high) == pytest.approx((expected.low, expected.high))


def test_the_report_has_the_section_its_tables_and_its_figure(tmp_path):
    records, layout = study(FLIPPING)
    text = whole(write_report(layout, records, tmp_path, {}, Description())[0])
    for phrase in (
        "### leto-aged, 30 draws",
        "| method | nominal rank | first in [% of draws] | mean rank | best rank | worst rank |",
        "| crosstalk (rank correlation +1.00, R2 1.00) |",
        "| crosstalk | px | 0.2 to 0.5 |",
        "0.25 px measured",
        "(figures/quality-ranks-leto-aged.png)",
    ):
        assert phrase in text, phrase
    assert "## Changes of the displays" not in text
    picture = imread(tmp_path / "figures" / "quality-ranks-leto-aged.png")
    assert picture.shape[1] == 900


CONFIG = """
title: Draws
display: {{profiles: [{profile}], panel: [128, 128]}}
targets: {{dataset: photographs, params: {{count: 1}}}}
sweeps: [{{condition: draw, count: 2}}, {more}{{condition: defocus, values: [0.1]}}]
methods: [double_phase]
"""


def swept_of(folder, profile, more=""):
    (folder / "study.yaml").write_text(CONFIG.format(profile=profile, more=more))
    return layout_of(load_study(folder / "study.yaml")).sweeps


def values_of(*indices):
    return tuple(draws.values(load_profile("leto-2020"), index) for index in indices)


def test_a_layout_knows_what_was_drawn_whether_the_profile_has_a_name_or_a_path(tmp_path):
    drawn, other = swept_of(tmp_path, "leto-2020")
    assert (drawn.drawn, other.drawn) == (values_of(1, 2), ())
    path = files("holobench_eval.display.simulated") / "profiles" / "leto-2020.yaml"
    (tmp_path / "own.yaml").write_text(path.read_text())
    assert swept_of(tmp_path, "own.yaml")[0] == drawn
    both, _ = swept_of(tmp_path, "leto-2020", "{condition: draw, values: [5]}, ")  # are one ranking
    assert [float(value) for value, _ in both.points] == [1, 2, 5]
    assert both.drawn == values_of(1, 2, 5)


def test_parameters_of_a_stage_that_the_display_lacks_are_not_among_what_was_drawn(tmp_path):
    (one, *_), _ = (swept.drawn for swept in swept_of(tmp_path, "ideal"))
    assert set(draws.PARAMETERS) - set(one) == {"fill", "linewidth", "stray", "reach"}
