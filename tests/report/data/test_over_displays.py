"""Margins over many displays, what of a display goes with them, and what two shares of its error tell of methods."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from holobench_eval.display import load_profile
from holobench_eval.metrics import control, error_budget
from holobench_eval.report import Results
from holobench_eval.report.answers import kind_of, over_displays
from holobench_eval.report.build import related
from holobench_eval.report.charts.family import draw_map
from holobench_eval.report.charts.look.methods import looks
from holobench_eval.report.charts.paired import draw_over_displays
from holobench_eval.report.data.board import board
from holobench_eval.report.data.over_displays import (
    display_map,
    gains,
    judged,
    left_out,
    margins,
    parameters,
    shown_on,
    winners,
)
from holobench_eval.report.data.statistics import FEWEST_DISPLAYS, cause
from holobench_eval.report.files import write_files
from tests.report.answers.test_answers import NOISE, TARGETS, results_of
from tests.support import synthetic_study as synthetic

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


def test_few_displays_and_oracles_alone_are_no_comparison_over_displays():
    few = DISPLAYS[: FEWEST_DISPLAYS - 1]
    results = results_of({f"{label}@{name}": 17.0 for name in few for label in ("old", "new")})
    assert kind_of(results) is not over_displays.KIND
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
    known = parameters(results)
    assert np.median([cause(draw.normal(size=10), known).explained for _ in range(50)]) < 0
    assert parameters(study(profiles={name: load_profile("ideal") for name in DISPLAYS})) == {}  # of no family


LINKS = {"terms": 0.5, "field": 0.1}  # what the models leave of the error, less a display's own share of it


def share(name: str) -> float:
    return 0.03 * DISPLAYS.index(name)


def measured(measure: str, scores: dict[str, dict[str, float]]) -> Results:
    """A study of the ten displays; scores: by ``label@display``."""
    rows = {tuple(key.split("@")): values for key, values in scores.items()}
    records = [
        synthetic.record(label, synthetic.cell(label, target, name, params={"label": label}), values)
        for (label, name), values in rows.items()
        for target in TARGETS
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


def test_two_shares_that_decide_name_the_best_method_of_displays_left_out(tmp_path: Path) -> None:
    results = crossing(budget=budget())
    found = display_map(results)
    assert found is not None
    np.testing.assert_allclose(found.shares[:, 0], [0.1 + share(name) for name in DISPLAYS])
    np.testing.assert_allclose(found.shares.sum(1), 0.9)
    assert set(winners(gains(results))) == {"new", "old"}
    assert found.hits >= 9
    assert found.explained("new") == pytest.approx(1)
    assert found.cost < 0.05 < min(map(found.always, found.labels))
    draw_map(tmp_path / "map.png", found, "difference [dB]", looks(results.names))
    assert (tmp_path / "map.png").stat().st_size > 5000


def test_a_display_left_out_is_predicted_as_by_a_fit_without_it() -> None:
    draw = np.random.default_rng(1)
    shares, values = draw.random((9, 2)), draw.normal(size=(3, 9))
    design = np.column_stack([np.ones(9), shares])
    for left in range(9):
        kept = np.arange(9) != left
        lines = np.linalg.lstsq(design[kept], values[:, kept].T, rcond=None)[0]
        np.testing.assert_allclose(left_out(shares, values)[:, left], design[left] @ lines)


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
    assert display_map(crossing(budget=Results(kept, some.layout))) is None


def test_a_score_of_models_is_judged_by_the_pairs_of_methods_that_it_orders() -> None:
    right = {"new": 0.9, "other": 0.5}
    of_models = models(right, {"new": 20.0, "other": 25.0})
    told = judged(replace(study(lambda name: 2.0), related={"models": of_models}))
    assert list(told.values()) == [(10, 10), (0, 10)]


def test_the_answer_names_the_best_method_what_to_measure_and_who_judges_models() -> None:
    results = crossing(budget=budget(), models=models({"new": 0.9, "other": 0.5}, {"new": 20.0, "other": 25.0}))
    told = " ".join(kind_of(results).answer(results))
    assert re.search(r"To choose, measure an error budget: it names the best method on (9|10) of 10 displays", told)
    assert "is best on 6 of 10." in told
    assert "predict margins on displays left out: R2 1.00 of new." in told
    told_of = " and ".join(f"{score} in {right} of {pairs}" for score, (right, pairs) in judged(results).items())
    assert f"that of the better model is the better one: by {told_of} pairs." in told
    always = replace(study(lambda name: 2.0), related={"budget": budget()})
    assert "To choose, measure nothing: always taking new costs" in " ".join(kind_of(always).answer(always))


def test_related_studies_of_many_displays_answer_with_means_over_them() -> None:
    of_errors, of_models = budget(), models({"new": 0.9, "other": 0.5}, {"new": 20.0, "other": 25.0})
    assert kind_of(of_errors).answer(of_errors) == [
        "Over 10 displays, the squared error is explained by the ideal image 0 % (0 to 0), terms 24 % (10 to 37), "
        "field 66 % (53 to 80), unexplained 9 % (9 to 9) and temporal noise 1 % (1 to 1)."
    ]
    by_psnr, by_control = kind_of(of_models).answer(of_models)
    assert by_psnr == "By PSNR other leads on 10 of 10 displays; its mean over 10 is 25.00 dB."
    assert by_control.startswith("By control new leads on 10 of 10 displays; its mean over 10 is 0.900")
    first = str(kind_of(of_models).table(board(of_models))).splitlines()[2]
    assert first.startswith("| new | 20.00 | 20.00 to 20.00 | 0.900")
    assert len(str(kind_of(of_errors).table(board(of_errors))).splitlines()) == 2 + 5


def test_the_report_reads_the_parts_that_predict_in_its_folder(tmp_path: Path) -> None:
    other = budget()
    (tmp_path / "budget").mkdir()
    write_files(other, tmp_path / "budget")
    layout = replace(study().layout, related={"budget": other.layout, "not run": other.layout})
    found = related(layout, tmp_path)
    assert list(found) == ["budget"]
    np.testing.assert_allclose(found["budget"].values("terms", DISPLAYS[3]), other.values("terms", DISPLAYS[3]))
