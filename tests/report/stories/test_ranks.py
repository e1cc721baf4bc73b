"""Rankings over draws of a display: made-up studies in which it is known what flips, and why."""

import math
from collections.abc import Callable, Mapping
from importlib.resources import files

import numpy as np
import pytest
from scipy import stats

from holobench_eval.display import load_profile
from holobench_eval.display.simulated.changes import draws
from holobench_eval.report import Results, facts_of, records_frame
from holobench_eval.report.facts import Swept
from holobench_eval.report.stories import answer
from holobench_eval.report.stories.ranks import Ranks, figures, flips, left_out, rankings
from holobench_eval.report.story import Report
from holobench_eval.study.config import load_study
from tests.support import made_facts
from tests.support import synthetic_study as synthetic

Quality = Callable[[Mapping[str, float]], float]

DISPLAY, COUNT, TARGETS = "leto-aged", 30, synthetic.TARGETS[:3]
LEVELS = dict(zip(TARGETS, (-2.0, 0.5, 1.5), strict=True))
PROFILE = load_profile(DISPLAY)
NOMINAL = {"crosstalk": 0.45, "zero_phase": -0.5, "astigmatism": 0.05, "gamma": 1.28}
MIDDLE = 0.35
"""Of the range of crosstalk."""


def study(methods: Mapping[str, Quality], count: int = COUNT, **changes):
    """Records and facts; methods: mean quality [dB] from a draw's parameters."""
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
    return records, made_facts.facts(**(given | changes))


def results_of(methods: Mapping[str, Quality], lost=(), **changes) -> Results:
    """The numbers of a study; lost: (label, draw, target) without a score, None for any."""
    records, facts = study(methods, **changes)
    for record in records:
        place = (record["label"], record["cell"]["condition"].rpartition("draw ")[2], record["cell"]["target"])
        if any(all(a in (None, b) for a, b in zip(each, place, strict=True)) for each in lost):
            record |= {"state": "failed", "scores": {}}
    return Results(records_frame(records, facts), facts)


def ranks_of(methods: Mapping[str, Quality], lost=(), **changes) -> Ranks:
    (ranks,) = rankings(results_of(methods, lost, **changes))
    return ranks


FLIPPING: Mapping[str, Quality] = {
    "steady": lambda values: 20.0,
    "robust": lambda values: 20.0 + 10 * (values["crosstalk"] - MIDDLE),
    "poor": lambda values: 12.0,
}


def test_a_method_that_wins_above_the_middle_of_a_parameter_flips_there_and_the_parameter_is_named():
    ranks = ranks_of(FLIPPING)
    high = np.array([values["crosstalk"] > MIDDLE for values in ranks.swept.drawn])
    assert 5 < high.sum() < 25
    assert list(ranks.ranks) == ["robust", "steady", "poor"]  # nominal crosstalk is high
    assert ranks.ranks[1:].to_numpy().tolist() == [[1, 2, 3] if up else [2, 1, 3] for up in high]
    assert ranks.taus == pytest.approx(np.where(high, 1.0, 1 / 3))
    first, expected = ranks.first("robust"), stats.binomtest(int(high.sum()), COUNT).proportion_ci(method="wilson")
    assert (first.mean, first.low, first.high) == pytest.approx((high.mean(), expected.low, expected.high))
    pair, *others = ranks.pairs
    assert (pair.first, pair.second, pair.flips) == ("robust", "steady", (~high).sum())
    assert pair.nominal == pytest.approx(1.0)
    assert [other.flips for other in others] == [0, 0]
    cause = ranks.cause(pair.draws)
    assert (cause.parameter, cause.rho, cause.explained) == ("crosstalk", pytest.approx(1), pytest.approx(1))


def test_lower_is_better_turns_the_ranking_and_not_the_meaning_of_a_lead():
    records, facts = study(FLIPPING, headline="mofd_srgb")
    for record in records:
        record["scores"] = {"mofd_srgb": record["scores"]["psnr_linear"]}
    (ranks,) = rankings(Results(records_frame(records, facts), facts))
    pair = ranks.pairs[0]
    assert (pair.first, pair.second, pair.nominal) == ("steady", "robust", pytest.approx(1.0))
    assert ranks.cause(pair.draws).rho > 0  # more crosstalk raises the score of robust, which is worse


def test_methods_that_are_far_apart_never_flip():
    ranks = ranks_of({"best": lambda v: 25.0 - v["crosstalk"], "middle": lambda v: 20.0, "last": lambda v: 15.0})
    assert (ranks.tau.low, ranks.tau.mean, ranks.tau.high) == (1, 1, 1)
    assert list(flips(ranks)) == []


def test_ties_share_the_first_place_flip_nothing_and_have_no_tau(tmp_path):
    results = results_of({"a": lambda v: 20.0, "b": lambda v: 20.0})
    (ranks,) = rankings(results)
    assert (ranks.ranks == 1).all(axis=None)
    assert ranks.first("a").mean == ranks.first("b").mean == 1
    assert list(flips(ranks)) == []
    assert list(figures(Report(results, [], tmp_path, {}, None))) == []
    assert answer(results)[0].startswith("Methods with all scores tie")


def test_a_difference_that_no_parameter_explains_is_said_to_have_none():
    ranks = ranks_of({"a": lambda v: 20.0 + math.sin(1e6 * v["gamma"]), "b": lambda v: 20.0})
    (row,) = flips(ranks)
    assert row["goes with"] == "nothing drawn"
    (row, *_) = flips(ranks_of(FLIPPING, count=4))  # which explain nothing, however well they are ordered
    assert row["goes with"] == "nothing drawn"


def test_an_angle_is_told_by_its_sine_and_cosine_and_a_signed_range_by_its_size_too():
    (turned,) = flips(ranks_of({"a": lambda v: 20.0 + math.cos(v["zero_phase"]), "b": lambda v: 20.0}))
    assert turned["goes with"].startswith("cosine of the phase of the unmod")
    (bent,) = flips(ranks_of({"a": lambda v: 20.0, "b": lambda v: 19.0 + 15 * abs(v["astigmatism"])}))
    assert bent["goes with"].startswith("size of the astigmatism (")


LACKS = "a ranked method lacks a target there (see Holes), as every method does where the camera cannot be registered."


def test_a_hole_takes_its_draw_from_all_methods_and_is_told():
    ranks, every = ranks_of(FLIPPING, lost=[("poor", "7", TARGETS[1])]), ranks_of(FLIPPING)
    assert ranks.quality.equals(every.quality.drop(7))
    assert ranks.drawn.equals(every.drawn.drop(7))
    assert list(left_out(ranks)) == [f"Draw 7 is left out (1 of 30): {LACKS}"]


def test_benches_on_which_nothing_could_be_scored_are_left_out():
    some = ranks_of(FLIPPING, lost=[(None, "3", None), (None, "9", None)])
    assert list(left_out(some)) == [f"Draws 3 and 9 are left out (2 of 30): {LACKS}"]
    none = ranks_of(FLIPPING, lost=[(None, str(index), None) for index in range(1, COUNT + 1)])
    assert not none.exists


def test_a_method_that_mostly_fails_is_not_ranked_and_takes_no_draws_from_the_others():
    ranks = ranks_of(FLIPPING, lost=[("poor", str(index), None) for index in range(1, 20)])
    assert ranks.quality.shape == (1 + COUNT, 2)
    (sentence,) = left_out(ranks)
    assert sentence.startswith("Not ranked")
    assert sentence.endswith(": poor.")


def test_oracles_and_methods_that_see_the_camera_are_not_ranked():
    ranks = ranks_of(FLIPPING, privileged=frozenset({"robust"}), camera=frozenset({"poor"}))
    assert list(ranks.quality) == ["steady"]
    assert not ranks.exists


def test_the_answer_says_who_stays_first_its_tau_and_who_turns():
    first, tau, turn = "".join(answer(results_of(FLIPPING))).split(". ")
    assert first == "robust, best on leto-aged, is best on 50 [33, 67] % of its draws"
    assert tau == "Kendall's tau of rankings is 0.67 [0.54, 0.79]"
    assert turn == "Most often steady passes robust, on 50 [33, 67] %."


CONFIG = """
title: Draws
display: {{profiles: [{profile}], panel: [128, 128]}}
targets: {{dataset: photographs, params: {{count: 1}}}}
sweeps: [{{condition: draw, count: 2}}, {more}{{condition: defocus, values: [0.1]}}]
methods: [double_phase]
"""


def swept_of(folder, profile, more=""):
    (folder / "study.yaml").write_text(CONFIG.format(profile=profile, more=more))
    return facts_of(load_study(folder / "study.yaml")).sweeps


def values_of(*indices):
    return tuple(draws.values(load_profile("leto-2020"), index) for index in indices)


def test_facts_know_what_was_drawn_whether_the_profile_has_a_name_or_a_path(tmp_path):
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
