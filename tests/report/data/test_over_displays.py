"""Margins over many displays, and what of a display goes with them."""

from __future__ import annotations

import numpy as np

from holobench_eval.display import load_profile
from holobench_eval.report.answers import kind_of, over_displays
from holobench_eval.report.charts.paired import draw_over_displays
from holobench_eval.report.data.over_displays import margins, parameters, shown_on
from holobench_eval.report.data.statistics import FEWEST_DISPLAYS, cause
from tests.report.answers.test_answers import NOISE, results_of

DISPLAYS = [f"leto-2020-{number:02d}" for number in range(1, 11)]
PROFILES = {name: load_profile(name) for name in DISPLAYS}


def study(gain=lambda name: 0.0, **changes):
    """Two methods on ten displays; the first is above the baseline by a gain of the display."""
    means = {f"{label}@{name}": 17.0 for name in DISPLAYS for label in ("old", "other")}
    means |= {f"new@{name}": 17.0 + gain(name) for name in DISPLAYS}
    given = {"question": "Is new better?", "profiles": PROFILES, "noise": lambda label: NOISE * (1 + (label == "new"))}
    return results_of(means, **(given | changes))


def test_a_margin_is_the_mean_over_targets_and_displays_that_show_it_are_counted():
    found = {each.label: each for each in margins(study(lambda name: 2.0 if name < "leto-2020-08" else 0.0))}
    assert (found["new"].better, found["new"].worse) == (7, 0)
    np.testing.assert_allclose(found["new"].values, [2.05] * 7 + [0.05] * 3)
    assert found["new"].over_both.low < 1.45 < found["new"].over_both.high
    assert found["other"].better == found["other"].worse == 0


def test_the_answer_says_on_how_many_displays_by_how_much_and_where_the_published_margin_falls(tmp_path):
    reported = {"new": {"psnr": 20.5}, "old": {"psnr": 17.6}}
    results = study(lambda name: 3.0 if name == DISPLAYS[0] else 1.0, reported=reported)
    assert kind_of(results) is over_displays.KIND
    first, *_ = kind_of(results).answer(results)
    assert first.startswith("new beats old on 10 of 10 displays: median +1.05 dB, +1.05 to +2.15 on nine")
    assert first.endswith("; 1 has the published +2.90 dB.")
    draw_over_displays(results, tmp_path / "chart.png")
    assert (tmp_path / "chart.png").stat().st_size > 5000


def test_few_displays_are_answered_each_by_itself():
    few = DISPLAYS[: FEWEST_DISPLAYS - 1]
    results = results_of({f"{label}@{name}": 17.0 for name in few for label in ("old", "new")})
    assert kind_of(results) is not over_displays.KIND


def test_oracles_alone_are_no_comparison_over_displays():
    means = {f"{label}@{name}": 17.0 for name in DISPLAYS for label in ("old", "new")}
    assert kind_of(results_of(means, privileged=frozenset({"new"}))) is not over_displays.KIND
    assert kind_of(results_of(means)) is over_displays.KIND


def test_a_display_that_lacks_a_score_is_left_out_and_named():
    results = study()
    lost = (results.frame["condition"] == DISPLAYS[3]) & (results.frame["target"] == "t2")
    results.frame.loc[lost, ["state", "psnr_linear"]] = "failed", np.nan
    assert DISPLAYS[3] not in shown_on(results)
    assert len(margins(results)[0].values) == len(DISPLAYS) - 1
    assert f"Left out, since scores are missing: {DISPLAYS[3]}." in kind_of(results).answer(results)


def test_the_parameter_that_decides_is_found_and_chance_predicts_nothing_of_a_display_left_out():
    crosstalk = {name: PROFILES[name].crosstalk.width for name in DISPLAYS}
    results = study(lambda name: 10 * crosstalk[name])
    found = cause(margins(results)[0].values, parameters(results))
    assert found.parameter == "crosstalk"
    assert found.rho > 0.99
    assert found.explained > 0.99
    draw = np.random.default_rng(1)
    explained = [cause(draw.normal(size=10), parameters(results)).explained for _ in range(50)]
    assert np.median(explained) < 0


def test_displays_of_no_family_have_no_parameters():
    assert parameters(study(profiles={name: load_profile("ideal") for name in DISPLAYS})) == {}
