from typing import Any

import numpy as np
import pytest

from holobench_eval.metrics import error_budget as scores
from holobench_eval.report.results import Results
from holobench_eval.report.stories.error_budget import budgets
from tests.support import synthetic_study as synthetic

METHODS = ("terms", "network", "field")
# Per target: what target, ideal image and the three methods leave, and the noise.
LEFT = {
    "astronaut": (0.100, 0.090, 0.050, 0.040, 0.012, 0.002),
    "coffee": (0.010, 0.0095, 0.006, 0.007, 0.0015, 0.0001),
    "rocket": (0.002, 0.0021, 0.0018, 0.0017, 0.0004, 0.0002),
}


def results(missing: str = "", noise: float | None = None) -> Results:
    records = [
        record(label, target, noise) for target in LEFT for label in METHODS if (label, target) != (missing, "coffee")
    ]
    return synthetic.results(records, baseline="terms", measure="error_budget", holograms="wirtinger (iterations = 50)")


def record(label: str, target: str, noise: float | None = None) -> dict[str, Any]:
    by_target, by_ideal, *by_methods, usual = LEFT[target]
    values = {
        "psnr_linear": 20.0,
        scores.TARGET: by_target,
        scores.IDEAL: by_ideal,
        scores.PREDICTION: by_methods[METHODS.index(label)],
        scores.NOISE: usual if noise is None else noise,
        scores.ALGORITHM: 0.001,
    }
    return synthetic.record(label, synthetic.cell(label, target, "ideal"), values)


def test_the_parts_add_up_and_the_gains_are_those_of_all_until_then() -> None:
    (budget,) = budgets(results())
    left = np.array(list(LEFT.values()))
    assert left[1, 3] > left[1, 2]  # on one target the network does worse than the terms,
    assert left[2, 1] > left[2, 0]  # on another the ideal image worse than the target
    assert sum(part.share.mean for part in budget.parts) == pytest.approx(1)
    gains = [part.gain.mean for part in budget.explained if part.gain]
    best = np.minimum.accumulate(left[:, :5], axis=1)
    assert gains == pytest.approx(10 * np.log10(left[:, :1] / best[:, 1:]).mean(0))
    assert budget.noise.gain is not None
    assert budget.noise.gain.mean == pytest.approx(10 * np.log10(left[:, 0] / left[:, 5]).mean())
    assert budget.psnr.mean == pytest.approx(-10 * np.log10(left[:, 0]).mean())
    shares = [part.share.mean for part in budget.explained]
    assert shares == pytest.approx((-np.diff(best / left[:, :1], axis=1)).mean(0))
    assert min(shares) >= 0  # what a worse prediction leaves alone is kept, and no part is negative
    alone = [part.alone.mean for part in budget.explained if part.alone]
    assert alone == pytest.approx((left[:, 1:5] / left[:, :1]).mean(0))


def test_noise_that_is_rounding_alone_sets_no_limit() -> None:
    (budget,) = budgets(results(noise=1e-17))
    assert budget.noise.gain is None
    assert budget.noise.share.mean == pytest.approx(0, abs=1e-12)


def test_a_target_without_noise_is_left_out_of_what_noise_allows(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(LEFT, "rocket", (*LEFT["rocket"][:5], 1e-17))
    (budget,) = budgets(results())
    left = np.array(list(LEFT.values()))[:2]
    assert budget.noise.gain is not None
    assert budget.noise.gain.mean == pytest.approx(10 * np.log10(left[:, 0] / left[:, 5]).mean())
    assert (budget.noise.gain.n, budget.noise.share.n) == (2, 3)


def test_a_display_without_all_scores_has_no_budget() -> None:
    assert budgets(results(missing="network")) == []
