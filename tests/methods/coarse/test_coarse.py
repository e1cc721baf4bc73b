"""What few levels cost, and what a method wins back, on an ideal panel of two levels and on one with a table."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import pytest
import torch

from holobench_eval.datasets.photographs import Photographs
from holobench_eval.display import DisplaySpec, load_profile
from holobench_eval.display.nominal import ideal_image, nominal_levels
from holobench_eval.methods.coarse.gumbel import Gumbel, gumbel_noise
from holobench_eval.methods.coarse.nearest_level import NearestLevel
from holobench_eval.methods.coarse.straight_through import StraightThrough
from holobench_eval.methods.common import matched
from holobench_eval.methods.wirtinger import Wirtinger
from holobench_eval.metrics.psnr import psnr
from holobench_eval.optics.phase import blaze, gray_level
from tests.support.open_loop import Bench

BINARY = replace(load_profile("ideal").spec((128, 128)), bits=1, wavelengths=(517e-9,))
TABULATED = replace(load_profile("plm-4bit").spec((128, 128)), wavelengths=(517e-9,), pupil=None)


@cache
def quality(method: Any, spec: DisplaySpec) -> float:
    """PSNR [dB] of what a faultless panel with these levels makes of a photograph."""
    target = Photographs(names=("camera",)).load("camera", spec.region.shape)[1:2].float()
    image = ideal_image(nominal_levels(method.solve(target[None], Bench(spec))[0], spec), spec)
    return float(psnr(matched(image, target).clamp(0, 1), target))


def test_to_know_the_table_gains_and_to_descend_on_it_gains_more() -> None:
    unaware, rounded = quality(Wirtinger(), TABULATED), quality(NearestLevel(), TABULATED)
    assert rounded > unaware + 2
    assert quality(StraightThrough(), TABULATED) > rounded + 1


def test_on_two_levels_annealing_gains_and_the_straight_through_gradient_does_not() -> None:
    rounded = quality(NearestLevel(), BINARY)
    assert rounded == pytest.approx(quality(Wirtinger(), BINARY), abs=1e-4)  # the display rounds as well
    assert quality(Gumbel(), BINARY) > rounded + 4
    assert quality(StraightThrough(), BINARY) < rounded + 1


@pytest.mark.parametrize("spec", [BINARY, TABULATED])
def test_the_nominal_image_is_that_of_the_levels_and_lets_gradients_through(spec: DisplaySpec) -> None:
    phase = 20 * torch.rand(1, *spec.shape, generator=torch.Generator().manual_seed(1)) - 10
    shown = spec.level_phases(0)[gray_level(phase + blaze(spec.shape, spec.blaze), spec.bits).long()]
    light = torch.polar(torch.ones_like(shown), shown - blaze(spec.shape, spec.blaze))
    image = spec.region.crop(spec.propagator(0).forward(light)).abs().square()
    asked = phase.requires_grad_()
    nominal = ideal_image(nominal_levels(asked, spec), spec)
    assert torch.allclose(nominal, image, atol=1e-4)
    (gradient,) = torch.autograd.grad(nominal.square().sum(), asked)
    assert float(gradient.abs().max()) > 0


def test_frames_that_are_found_together_gain_on_one_frame() -> None:
    assert (
        quality(Gumbel(frames=4, initial_phase="narrow"), BINARY) > quality(Gumbel(initial_phase="narrow"), BINARY) + 3
    )


def test_gumbel_noise_has_the_mean_and_spread_of_its_distribution() -> None:
    noise = gumbel_noise((400_000,), torch.Generator().manual_seed(1)).double()
    assert float(noise.mean()) == pytest.approx(0.5772, abs=0.01)
    assert float(noise.std()) == pytest.approx(torch.pi / 6**0.5, abs=0.01)
