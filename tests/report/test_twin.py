"""What is told of a twin is what was put between it and its display."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import torch
from torch import Tensor

from holobench_eval.display.simulated.trust import Trust
from holobench_eval.report.twin import Noise, Shown, Trial, further

SHAPE = (3, 96, 128)
LIKE = np.full((3, 4), 35.0)


def draw(seed: int) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


def photograph(light: Tensor, seed: int, factor: float = 1.0) -> Tensor:
    """Read noise of 0.01 and shot noise of 0.002 I, at any brightness."""
    noise = (1e-4 + 2e-3 * light.clamp_min(0)).sqrt() * torch.randn(light.shape, generator=draw(seed))
    return factor * (light + noise)


@pytest.fixture(scope="module")
def light() -> Tensor:
    return torch.rand(SHAPE, generator=draw(1)) ** 2


@pytest.mark.parametrize("flicker", [1.0, 0.8])
def test_noise_is_told_from_pairs_whatever_their_brightness(light: Tensor, flicker: float) -> None:
    noise = Noise.of([(photograph(light, 2), photograph(light, 3, flicker))])
    assert noise(light).tolist() == pytest.approx([float((1e-4 + 2e-3 * each).mean()) for each in light], rel=0.03)


@pytest.mark.parametrize("error", [0.0, 0.02, 0.05])
def test_a_capture_is_further_than_a_second_photograph_by_its_error(light: Tensor, error: float) -> None:
    first, noise = photograph(light, 4), Noise.of([(photograph(light, 2), photograph(light, 3))])
    twin = photograph(light + error * torch.randn(SHAPE, generator=draw(5)), 6, factor=3.0)
    variance = noise(light).mean()
    wanted = 10 * math.log10(1 + error**2 / (2 * float(variance)))
    likeness, told = further(first, twin, light, noise)
    assert float((likeness + told)[0]) == pytest.approx(-10 * math.log10(2 * float(variance)), abs=0.05)
    assert told.tolist() == pytest.approx([wanted] * 4, abs=0.2)  # the match takes a little of any error


def trial() -> Trial:
    display = {"good": np.array([20.0, 22.0, 24.0]), "bad": np.array([18.0, 19.0, 20.0]), "own": np.full(3, 30.0)}
    shown = {label: Shown(scores + 0.5, LIKE, np.ones((3, 4))) for label, scores in display.items()}
    own = {**shown, "own": Shown(display["own"] + np.array([1.0, 2.0, 3.0]), LIKE, np.full((3, 4), 2.0))}
    turned = {**shown, "bad": Shown(display["bad"] + 9, LIKE, np.ones((3, 4)))}
    return Trial("lab", "bench", "own", 59, ("a", "b", "c"), display, {"lab": own, "lab-turned": turned})


def test_flattery_is_what_its_own_holograms_score_more_on_the_twin() -> None:
    flattery = trial().difference("own")
    assert (flattery.mean, flattery.high - flattery.mean) == pytest.approx((2, 2.4841), abs=1e-3)


def test_differences_of_methods_are_compared_in_pairs_and_orders() -> None:
    found = trial()
    assert found.worst().apart == pytest.approx(0)
    assert found.worst(learned=True).apart == pytest.approx(1.5)
    assert found.worst("lab-turned").apart == pytest.approx(8.5)
    assert (found.tau(), found.tau("lab-turned")) == pytest.approx((1, 1 / 3))


def test_a_profile_says_what_its_twin_was_tried_on() -> None:
    trust = trial().trust()
    assert trust == Trust("bench", 59, 3, {"good": 1.0, "bad": 1.0, "own": 2.0}, 2.0, 2.48)
    assert "trained with 59 photographs" in trust.words
    assert "score 2.0 ± 2.5 dB too high" in trust.words
    assert "more than 3 dB" not in trust.words
    assert "more than 3 dB: it does not tell" in replace(trust, flattery=3.1).words
    assert Trust().words == ""
