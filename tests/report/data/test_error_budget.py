from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from holobench_eval.metrics import error_budget as scores
from holobench_eval.report.data.error_budget import Budget, budgets, chosen
from holobench_eval.report.data.results import Results
from holobench_eval.report.data.tables import records_frame
from tests.support import synthetic_study as synthetic

METHODS = ("terms", "network", "field")
# Per target: what target, ideal image and the three methods leave, and the noise.
LEFT = {
    "astronaut": (0.100, 0.090, 0.050, 0.040, 0.012, 0.002),
    "coffee": (0.010, 0.0095, 0.006, 0.007, 0.0015, 0.0001),
    "rocket": (0.002, 0.0021, 0.0018, 0.0017, 0.0004, 0.0002),
}
HELD_OUT = {"ideal": 0.97, "terms": 0.6, "network": 0.5, "field": 0.1}


def results(held_out: dict[str, float], missing: str = "") -> Results:
    layout = synthetic.layout(
        pairs=tuple((label, "ideal") for label in METHODS),
        targets=tuple(LEFT),
        baseline="terms",
        privileged=frozenset(),
        reported={},
        measure="error_budget",
        holograms="wirtinger (iterations = 50)",
    )
    records = [
        record(label, target, held_out)
        for target in LEFT
        for label in METHODS
        if (label, target) != (missing, "coffee")
    ]
    return Results(records_frame(records, layout), layout)


def record(label: str, target: str, held_out: dict[str, float]) -> dict[str, Any]:
    by_target, by_ideal, *by_methods, noise = LEFT[target]
    values = {
        "psnr_linear": 20.0,
        scores.TARGET: by_target,
        scores.IDEAL: by_ideal,
        scores.PREDICTION: by_methods[METHODS.index(label)],
        scores.NOISE: noise,
        scores.ALGORITHM: 0.001,
        scores.HELD_OUT_IDEAL: held_out["ideal"],
        scores.HELD_OUT: held_out[label],
    }
    return synthetic.record(label, synthetic.cell(label, target, "ideal"), values)


def shares(budget: Budget) -> dict[str, float]:
    return {part.label: part.share.mean for part in budget.parts}


def test_a_part_is_what_one_prediction_explains_beyond_the_one_before_in_shares_of_each_target() -> None:
    (budget,) = budgets(results(HELD_OUT))
    left = np.array(list(LEFT.values()))
    expected = -np.diff(left / left[:, :1], axis=1).mean(0)
    assert list(shares(budget).values()) == pytest.approx([*expected, (left[:, 5] / left[:, 0]).mean()])
    assert sum(shares(budget).values()) == pytest.approx(1)
    gains = [part.gain.mean for part in budget.explained if part.gain]
    assert gains == pytest.approx(10 * np.log10(left[:, :1] / left[:, 1:5]).mean(0))
    assert budget.psnr.mean == pytest.approx(-10 * np.log10(left[:, 0]).mean())


def test_a_prediction_that_held_out_captures_speak_against_gives_way_to_the_one_before() -> None:
    (budget,) = budgets(results(HELD_OUT | {"network": 0.65}))
    assert shares(budget)["network"] == 0
    assert [part.stands for part in budget.explained] == ["the ideal image", "terms", "terms", "field"]
    assert sum(shares(budget).values()) == pytest.approx(1)


def test_a_part_below_zero_is_kept_where_held_out_captures_promised_more() -> None:
    (budget,) = budgets(results(HELD_OUT | {"field": 0.55, "network": 0.01}))
    assert shares(budget)["field"] == 0
    (budget,) = budgets(results(HELD_OUT | {"terms": 0.01, "network": 0.005, "field": 0.001, "ideal": 2.0}))
    assert shares(budget)["the ideal image"] == 0  # the target predicts better, and stands for it
    assert shares(budget)["terms"] > 0


def test_an_unknown_held_out_error_leaves_every_prediction_to_itself() -> None:
    assert chosen([1.0, 0.5, float("nan"), 0.9]) == [0, 1, 2, 3]
    assert chosen([1.0, 1.2, 0.9, 0.95]) == [0, 0, 2, 2]


def test_a_display_without_all_scores_has_no_budget() -> None:
    assert budgets(results(HELD_OUT, missing="network")) == []
