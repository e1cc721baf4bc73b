"""What few levels cost and what a method wins back, on two levels and on a published table; the nearest level."""

import math
from dataclasses import replace
from functools import cache
from typing import Any

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from holobench_eval.datasets.photographs import Photographs
from holobench_eval.display import load_profile
from holobench_eval.display.api import DisplaySpec
from holobench_eval.display.nominal import ideal_image, nominal_levels
from holobench_eval.methods.coarse.gumbel import Gumbel, gumbel_noise
from holobench_eval.methods.coarse.levels import Levels
from holobench_eval.methods.coarse.nearest_level import NearestLevel
from holobench_eval.methods.coarse.straight_through import StraightThrough
from holobench_eval.methods.common import matched
from holobench_eval.methods.wirtinger import Wirtinger
from holobench_eval.metrics.psnr import psnr
from holobench_eval.optics.phase import TAU, blaze, gray_level
from tests.support.open_loop import Bench
from tests.support.small_training import small_spec

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
    one, four = (Gumbel(frames=frames, iterations=100, initial_phase="narrow") for frames in (1, 4))
    assert quality(four, BINARY) > quality(one, BINARY) + 3  # frames that are found together


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


def test_gumbel_noise_has_the_mean_and_spread_of_its_distribution() -> None:
    noise = gumbel_noise((400_000,), torch.Generator().manual_seed(1)).double()
    assert float(noise.mean()) == pytest.approx(0.5772, abs=0.01)
    assert float(noise.std()) == pytest.approx(torch.pi / 6**0.5, abs=0.01)


PHASE = st.floats(-20, 20)
VALUES = st.floats(0, TAU, exclude_max=True)
TABLES = st.sampled_from([2, 16]).flatmap(lambda n: st.lists(VALUES, min_size=n, max_size=n, unique=True))


@given(TABLES, PHASE)
def test_no_other_level_is_nearer_around_the_circle(table: list[float], phase: float) -> None:
    spec = replace(small_spec(8, 8), shape=(1, 1), bits=int(math.log2(len(table))), levels=(tuple(table),))
    shown = torch.full((1, 1), phase).double()
    level = int(Levels(spec, 0, torch.zeros((), dtype=torch.float64)).nearest(shown))
    apart = [abs(math.remainder(phase - value, TAU)) for value in table]
    assert apart[level] == pytest.approx(min(apart), abs=1e-6)  # a spec keeps its table in float32


@pytest.mark.parametrize("cycles", [(0.0, 0.0), (0.25, -0.11)])
@pytest.mark.parametrize("bits", [1, 4, 8])
def test_the_display_shows_the_level_that_is_meant(bits: int, cycles: tuple[float, float]) -> None:
    spec = replace(small_spec(16, 8), bits=bits, blaze=cycles)
    wanted = torch.randint(2**bits, spec.shape, generator=torch.Generator().manual_seed(1))
    given = Levels(spec, 0, torch.zeros(())).shown_by(wanted)
    assert torch.equal(gray_level(given + blaze(spec.shape, cycles), bits), wanted.float())


def test_equal_steps_are_what_the_display_would_choose_itself() -> None:
    spec = small_spec(16, 8)
    phase = 40 * torch.rand(spec.shape, generator=torch.Generator().manual_seed(1)) - 20
    assert torch.equal(Levels(spec, 0, phase).nearest(phase).float(), gray_level(phase, spec.bits))


def test_light_from_a_level_has_the_phase_that_the_bench_gives_it() -> None:
    profile = load_profile("plm-4bit")
    spec = profile.spec((64, 64))
    level = torch.arange(16.0).view(4, 4)
    levels = Levels(spec, 1, level)
    assert torch.allclose(levels.light(level.long()), profile.lut.phase(level, 4, torch.ones(()), 1), atol=1e-5)
