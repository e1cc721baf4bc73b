"""Margins over many displays, what of a display goes with them, and what two shares of its error tell of methods."""

import re
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from holobench_eval.display import load_profile
from holobench_eval.metrics import control, error_budget
from holobench_eval.report import Results, build
from holobench_eval.report.statistics import FEWEST_DISPLAYS, cause
from holobench_eval.report.stories import answer, many_displays, story_of
from holobench_eval.report.stories.many_displays import display_map, judged, margins, missed, parameters, shown_on
from tests.support import synthetic_study as synthetic
from tests.support.reports import write_texts
from tests.support.synthetic_study import EIGHT, NOISE, results_of

DISPLAYS = [f"leto-2020-{number:02d}" for number in range(1, 11)]
PROFILES = {name: load_profile(name) for name in DISPLAYS}


def study(gain=lambda name: 0.0, **changes):
    """Two methods on ten displays; the first is above the baseline by a gain of the display."""
    means = {f"{label}@{name}": 17.0 for name in DISPLAYS for label in ("old", "other")}
    means |= {f"new@{name}": 17.0 + gain(name) for name in DISPLAYS}
    given = {"question": "Is new better?", "profiles": PROFILES, "noise": lambda label: NOISE * (1 + (label == "new"))}
    return results_of(means, **(given | changes))


def test_a_margin_is_the_mean_over_targets_and_displays_that_show_it_are_counted():
    results = study(lambda name: 2.0 if name < "leto-2020-08" else 0.0)
    found = {each.label: each for each in margins(results)}
    assert (found["new"].better, found["new"].worse) == (7, 0)
    np.testing.assert_allclose(found["new"].values, [2.05] * 7 + [0.05] * 3)
    assert found["new"].over_both.low < 1.45 < found["new"].over_both.high
    assert found["other"].better == found["other"].worse == 0


def test_few_displays_and_oracles_alone_are_no_comparison_over_displays():
    few = {f"{label}@{name}": 17.0 for name in DISPLAYS[: FEWEST_DISPLAYS - 1] for label in ("old", "new")}
    many = {f"{label}@{name}": 17.0 for name in DISPLAYS for label in ("old", "new")}
    assert story_of(results_of(few)) is not many_displays
    assert story_of(results_of(many, privileged=frozenset({"new"}))) is not many_displays
    assert story_of(results_of(many)) is many_displays


def test_methods_that_are_best_on_as_many_displays_are_all_named():
    results = study(
        lambda name: 2.0 if name < "leto-2020-06" else -2.0, noise=lambda label: NOISE + 0.5 * (label == "other")
    )
    assert "Best on most displays: other and new, on 5 of 10 each." in answer(results)


def test_on_two_clusters_no_display_is_counted_as_one_without_a_difference():
    results = study(lambda name: 2.0)
    results.frame["cluster"] = ["a" if target in EIGHT[:4] else "b" for target in results.frame["target"]]
    text = " ".join(answer(results))
    assert "new against old on 10 displays, untested: median +2.05 dB" in text
    assert "beats" not in text


def test_a_display_that_lacks_a_score_is_left_out_and_named():
    results = study()
    lost = (results.frame["condition"] == DISPLAYS[3]) & (results.frame["target"] == "t2")
    results.frame.loc[lost, ["state", "psnr_linear"]] = "failed", np.nan
    assert DISPLAYS[3] not in shown_on(results)
    assert len(margins(results)[0].values) == len(DISPLAYS) - 1
    assert f"Left out, since scores are missing: {DISPLAYS[3]}." in answer(results)


def test_the_parameter_that_decides_is_found_and_chance_predicts_nothing_of_a_display_left_out():
    crosstalk = {name: PROFILES[name].crosstalk.width for name in DISPLAYS}
    results = study(lambda name: 10 * crosstalk[name])
    found = cause(margins(results)[0].values, parameters(results))
    assert found.parameter == "crosstalk"
    assert found.rho > 0.99
    assert found.explained > 0.99
    draw = np.random.default_rng(1)
    known = parameters(results)
    assert np.median([cause(draw.normal(size=10), known).explained for _ in range(50)]) < 0
    assert parameters(study(profiles={name: load_profile("ideal") for name in DISPLAYS})) == {}  # of no family


def share(name: str) -> float:
    return 0.03 * DISPLAYS.index(name)


def measured(measure: str, scores: dict[str, dict[str, float]]) -> Results:
    """A study of the ten displays; scores: by ``label@display``."""
    rows = {tuple(key.split("@")): values for key, values in scores.items()}
    records = [
        synthetic.record(label, synthetic.cell(label, target, name, params={"label": label}), values)
        for (label, name), values in rows.items()
        for target in EIGHT
    ]
    return synthetic.results(records, baseline=next(iter(rows))[0], measure=measure)


def budget() -> Results:
    """Image terms explain more, and the field model as much less, from display to display."""
    known = {error_budget.TARGET: 1.0, error_budget.IDEAL: 1.0, error_budget.NOISE: 0.01, error_budget.ALGORITHM: 0.01}
    left = {f"terms@{name}": 0.9 - share(name) for name in DISPLAYS} | {f"field@{name}": 0.1 for name in DISPLAYS}
    return measured(
        "error_budget",
        {key: {"psnr_linear": 20.0, error_budget.PREDICTION: value, **known} for key, value in left.items()},
    )


def models(answers: dict[str, float], predicts: dict[str, float]) -> Results:
    scores = {
        f"{label}@{name}": {"psnr_linear": predicts[label], control.NAME: value, control.MOST: 1.0}
        for label, value in answers.items()
        for name in DISPLAYS
    }
    return measured("prediction", scores)


def crossing(**related: Results) -> Results:
    """``new`` is best where image terms explain little, ``other`` elsewhere."""
    found = study(lambda name: 1.0 - 10 * share(name), noise=lambda label: NOISE)
    return replace(found, related=related)


def test_two_shares_that_decide_name_the_best_method_of_displays_left_out() -> None:
    results = crossing(budget=budget())
    known = display_map(results)
    assert known is not None
    np.testing.assert_allclose(known.shares.iloc[:, 0], [0.1 + share(name) for name in DISPLAYS])
    np.testing.assert_allclose(known.shares.sum(axis=1), 0.9)
    assert set(known.margins.idxmax(axis=1)) == {"new", "old"}
    assert known.hits >= 9
    assert known.explained("new") == pytest.approx(1)
    assert known.behind(known.chosen) < 0.05 < min(known.behind(known.margins[label]) for label in known.margins)


def test_a_display_left_out_is_predicted_as_by_a_fit_without_it() -> None:
    draw = np.random.default_rng(1)
    shares, values = pd.DataFrame(draw.random((9, 2))), pd.DataFrame(draw.normal(size=(9, 3)))
    residuals = missed(shares, values)
    design = np.column_stack([np.ones(9), shares])
    for left in range(9):
        kept = np.arange(9) != left
        lines = np.linalg.lstsq(design[kept], values[kept], rcond=None)[0]
        np.testing.assert_allclose(values.iloc[left] - residuals.iloc[left], design[left] @ lines)


def test_shares_that_decide_nothing_explain_nothing() -> None:
    draw = np.random.default_rng(2)
    explained = []
    for _ in range(5):
        gains = dict(zip(DISPLAYS, draw.normal(size=10), strict=True))
        found = display_map(replace(study(gains.__getitem__), related={"budget": budget()}))
        assert found is not None
        explained.append(found.explained("new"))
    assert np.median(explained) < 0


def test_without_a_budget_of_all_displays_there_is_no_map() -> None:
    assert display_map(crossing()) is None
    some = budget()
    kept = some.frame[some.frame["condition"] != DISPLAYS[2]]
    assert display_map(crossing(budget=Results(kept, some.facts))) is None


def test_a_score_of_models_is_judged_by_the_pairs_of_methods_that_it_orders() -> None:
    right = {"new": 0.9, "other": 0.5}
    of_models = models(right, {"new": 20.0, "other": 25.0})
    pairs = judged(replace(study(lambda name: 2.0), related={"models": of_models}))
    assert list(pairs.values()) == [(10, 10), (0, 10)]


def test_the_answer_names_what_to_measure_where_it_pays() -> None:
    results = crossing(budget=budget(), models=models({"new": 0.9, "other": 0.5}, {"new": 20.0, "other": 25.0}))
    text = " ".join(answer(results))
    assert "Best on most displays: old, on 6 of 10." in text
    assert "To choose, measure an error budget: always taking old costs 0.22 dB in the mean;" in text
    assert re.search(
        r"an error budget names the best method on (9|10) of 10 displays left out and costs 0\.0[0-4] dB", text
    )
    assert "An error budget predicts margins on displays left out with R2 1.00 for new." in text


@pytest.mark.parametrize(("differs", "names"), [("", ["budget"]), ("1 of 2 planned cells are not there", [])])
def test_the_report_reads_the_parts_that_predict_and_are_as_planned(tmp_path, monkeypatch, differs, names) -> None:
    other = budget()
    write_texts(other, tmp_path / "budget")
    write_texts(other, tmp_path / "damaged")
    (tmp_path / "damaged" / "records.csv").write_text("")
    monkeypatch.setattr(build, "plan", lambda study: study)
    monkeypatch.setattr(build, "difference", lambda frame, grid: differs)
    facts = replace(study().facts, related=dict.fromkeys(("budget", "damaged", "not run"), other.facts))
    parts = build.related(facts, tmp_path)
    assert list(parts) == names
    for part in parts.values():
        np.testing.assert_allclose(part.values("terms", DISPLAYS[3]), other.values("terms", DISPLAYS[3]))
