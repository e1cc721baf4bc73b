"""What is told of a twin is what was put between it and its display."""

import math
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
import torch
from torch import Tensor
from torch.nn import functional

from holobench_eval.display.simulated.trust import Trust
from holobench_eval.report.statistics import Array
from holobench_eval.report.twin import Trial, compared, further, misfit, noise_of

SHAPE = (3, 96, 128)


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
    noise = noise_of([(photograph(light, 2), photograph(light, 3, flicker))])
    variance = compared(light, light, light, noise)["noise"] / 2
    assert variance.tolist() == pytest.approx([float((1e-4 + 2e-3 * each).mean()) for each in light], rel=0.03)


@pytest.mark.parametrize("error", [0.0, 0.02, 0.05])
def test_a_capture_is_further_than_a_second_photograph_by_its_error(light: Tensor, error: float) -> None:
    first, noise = photograph(light, 4), noise_of([(photograph(light, 2), photograph(light, 3))])
    twin = photograph(light + error * torch.randn(SHAPE, generator=draw(5)), 6, factor=3.0)
    twice = float(compared(light, light, light, noise)["noise"].mean())
    wanted = 10 * math.log10(1 + error**2 / twice)
    likeness, told = further(compared(first, twin, light, noise))
    assert (likeness + told)[0] == pytest.approx(-10 * math.log10(twice), abs=0.05)
    assert told.tolist() == pytest.approx([wanted] * 4, abs=0.2)  # the match takes a little of any error


def shot(seed: int, smooth: int, off: float, away: float) -> dict[str, Array]:
    """Of a picture with details of so many pixels, whose light is off by a share, and out of place by pixels."""
    light = functional.interpolate(
        torch.rand((1, 3, *(side // smooth for side in SHAPE[1:])), generator=draw(seed)), SHAPE[1:]
    )
    light = functional.avg_pool2d(light, 5, 1, 2)[0]
    vertical, across = (away * torch.randn(SHAPE, generator=draw(seed + step)) for step in (1, 2))
    slopes = (torch.gradient(light, dim=axis)[0] for axis in (1, 2))
    moved = light + sum(by * slope for by, slope in zip((vertical, across), slopes, strict=True))
    wrong = moved * (1 + off * torch.randn(SHAPE, generator=draw(seed + 3)))
    noise = noise_of([(photograph(light, seed + 6), photograph(light, seed + 7))])
    return compared(photograph(light, seed + 4), photograph(wrong, seed + 5), light, noise)


def told(off: tuple[Array, Array], shot: dict[str, Array]) -> float:
    """What a misfit says of ``further`` [dB], of all colours, by capture and noise alone."""
    error = shot["light"] * off[0] ** 2 + shot["slope"] * off[1] ** 2
    return float(10 * np.log10((shot["noise"] + error).mean() / shot["noise"].mean()))


@pytest.mark.parametrize(("off", "away"), [(0.0, 0.0), (0.1, 0.0), (0.0, 0.3), (0.1, 0.3)])
def test_a_misfit_in_light_and_in_place_tells_the_distance_of_other_pictures(off: float, away: float) -> None:
    found = misfit([shot(seed, smooth, off, away) for seed, smooth in ((10, 2), (20, 4), (30, 8), (40, 16))])
    if not away:  # noise has slopes, too, and what is out of place more
        assert found[0] == pytest.approx([off] * 3, abs=0.02)
    for seed, smooth in ((50, 3), (60, 6), (70, 12)):
        other = shot(seed, smooth, off, away)
        assert told(found, other) == pytest.approx(float(further(other)[1][0]), abs=0.5)


def trial() -> Trial:
    scores = {"good": np.array([20.0, 22.0, 24.0]), "bad": np.array([18.0, 19.0, 20.0]), "own": np.full(3, 30.0)}
    values = {("score", "bench", label): own for label, own in scores.items()}
    for twin, label, more in (("lab", "own", np.array([1.0, 2.0, 3.0])), ("lab-turned", "bad", 9.0)):
        shown = {key: own + (more if key == label else 0.5) for key, own in scores.items()}
        values |= {("score", twin, key): own for key, own in shown.items()}
        values |= {("further", twin, key): np.full(3, 1.0 + (key == "own")) for key in scores}
    return Trial("lab", "bench", "own", 59, pd.DataFrame(values), {}, (np.full(3, 0.1), np.full(3, 0.05)))


def test_flattery_is_what_its_own_holograms_score_more_on_the_twin() -> None:
    flattery = trial().difference("own")
    assert (flattery.mean, flattery.high - flattery.mean) == pytest.approx((2, 2.4841), abs=1e-3)


def test_differences_of_methods_are_compared_in_pairs_and_orders() -> None:
    found = trial()
    assert found.worst() == pytest.approx(0)
    assert found.worst(learned=True) == pytest.approx(1.5)
    assert found.worst("lab-turned") == pytest.approx(8.5)
    assert (found.tau(), found.tau("lab-turned")) == pytest.approx((1, 1 / 3))


def test_a_profile_says_what_its_twin_was_tried_on() -> None:
    trust = trial().trust()
    assert trust == Trust("bench", 59, 3, {"good": 1.0, "bad": 1.0, "own": 2.0}, (0.1,) * 3, (0.05,) * 3, 2.0, 2.48)
    assert "trained with 59 photographs" in trust.words
    assert "score 2.0 ± 2.5 dB too high" in trust.words
    assert "more than 3 dB" not in trust.words
    assert "more than 3 dB: it does not tell" in replace(trust, flattery=3.1).words
    assert Trust().words == ""
