"""Wirtinger holography through a veil: the two numbers are those of the display, and what is dark stays darker."""

from __future__ import annotations

from dataclasses import replace

import pytest
import torch

from holobench_eval.display import Profile, load_profile
from holobench_eval.display.api import Region
from holobench_eval.display.simulated.stages import StrayLight
from holobench_eval.display.training import TrainingBench, TrainingImage
from holobench_eval.methods.calibrated.patterns import dark_patterns
from holobench_eval.methods.predictors.veil import REACHES, WirtingerVeil, fitted, veiled
from holobench_eval.study.opening import open_bench
from tests.support.small_training import Memory

PANEL = (128, 128)


@pytest.mark.parametrize(("share", "reach"), [(0.0, REACHES[20]), (0.3, REACHES[24]), (0.7, REACHES[12])])
@pytest.mark.parametrize("black", [0.0, 0.05])
def test_a_veil_is_found_at_any_brightness_and_black_level(share: float, reach: float, black: float) -> None:
    draw = torch.Generator().manual_seed(1)
    region, light = Region(16, 16, 96, 96), torch.rand(3, 1, 128, 128, generator=draw)
    light[:, :, :, 64:] = 0
    captures = 0.6 * region.crop(veiled(light, share, reach)) + black
    found, far = fitted(light, captures, region)
    assert found == pytest.approx(share, abs=0.005)
    assert share == 0 or far == reach


def test_most_of_every_pattern_is_dark() -> None:
    for pattern in dark_patterns(torch.zeros(104, 96)).values():
        assert set(pattern.unique().tolist()) == {0.0, 1.0}
        assert float(pattern.mean()) <= 0.5


def test_a_veil_keeps_the_light_that_stays_in_the_picture() -> None:
    light = torch.zeros(1, 96, 96)
    light[:, 44:52, 44:52] = 1
    assert float(veiled(light, 0.5, 0.05).sum()) == pytest.approx(64, rel=1e-3)
    assert torch.equal(veiled(light, 0.0, 0.1), light)


def display(share: float) -> Profile:
    return replace(load_profile("ideal").scaled(PANEL), stray_light=StrayLight(share, 0.125))


def test_the_numbers_are_those_of_a_display_and_cost_three_captures() -> None:
    image = TrainingImage("any", torch.full((3, 104, 104), 0.5))
    bench = TrainingBench(open_bench(display(0.5), PANEL, 0), "veil", [image], [image], Memory(), 3, 0)
    learned = WirtingerVeil().prepare(bench)
    assert bench.captures == 3
    assert learned["share"] == pytest.approx(0.5, abs=0.02)
    assert learned["reach"] == pytest.approx(0.125, rel=0.1)
