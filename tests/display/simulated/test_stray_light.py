"""Stray light lies over the image as a veil: it adds in intensity, keeps the power and knows no fringes."""

from __future__ import annotations

from dataclasses import replace

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import gaussian_filter
from torch import Tensor

from holobench_eval.display import Profile
from holobench_eval.display.simulated.geometry import Geometry
from holobench_eval.display.simulated.pipeline import SimulatedBench
from holobench_eval.display.simulated.stages import StrayLight
from holobench_eval.display.simulated.stages.stray_light import gaussian


@settings(max_examples=20, deadline=None)
@given(st.floats(1, 80), st.integers(5, 90), st.integers(5, 90))
def test_the_veil_is_a_gaussian(spread: float, rows: int, columns: int) -> None:
    light = torch.rand(rows, columns, generator=torch.Generator().manual_seed(1))
    expected = torch.from_numpy(gaussian_filter(light.double().numpy(), spread, mode="constant", truncate=8)).float()
    assert torch.allclose(gaussian(light, spread), expected, atol=3e-4 * float(expected.max()))


def test_a_fine_checkerboard_keeps_the_stated_contrast(ideal: Profile, geometry: Geometry) -> None:
    y, x = torch.meshgrid(torch.arange(512), torch.arange(512), indexing="ij")
    board = ((y // 8 + x // 8) % 2).float()
    seen = StrayLight(share=0.4, reach=0.1).image(board, ideal, geometry)[200:312, 200:312]
    inner = board[200:312, 200:312] == 1
    assert float(seen[inner].mean() / seen[~inner].mean()) == pytest.approx(0.8 / 0.2, rel=0.01)


def test_the_power_stays_but_for_what_leaves_the_image(ideal: Profile, geometry: Geometry) -> None:
    light = torch.zeros(200, 200)
    light[90:110, 90:110] = 1
    assert float(StrayLight(0.5, 0.05).image(light, ideal, geometry).sum()) == pytest.approx(400, rel=1e-3)
    assert float(StrayLight(0.5, 1.0).image(light, ideal, geometry).sum()) < 250
    light = torch.zeros(21, 21)
    light[10, 10] = 1  # and a veil that is narrower than a sample
    assert float(StrayLight(1.0, 0.01).image(light, ideal, geometry).sum()) == pytest.approx(1, rel=1e-3)


def test_two_images_add_with_their_veils(ideal: Profile, geometry: Geometry) -> None:
    a, b = torch.rand(2, 64, 96, generator=torch.Generator().manual_seed(1))
    stage = StrayLight(0.3, 0.2)
    apart = stage.image(a, ideal, geometry) + stage.image(b, ideal, geometry)
    assert torch.allclose(stage.image(a + b, ideal, geometry), apart, atol=1e-6)


def test_the_veil_does_not_depend_on_the_samples_a_pixel(ideal: Profile, geometry: Geometry) -> None:
    coarse = torch.rand(24, 32, generator=torch.Generator().manual_seed(1))
    fine = coarse.repeat_interleave(4, 0).repeat_interleave(4, 1)
    stage = StrayLight(1.0, 0.2)
    seen = stage.image(fine, ideal, geometry).view(24, 4, 32, 4).mean((1, 3))
    assert torch.allclose(seen, stage.image(coarse, ideal, geometry), rtol=0.01)


def test_the_gradient_is_that_of_the_veil(ideal: Profile, geometry: Geometry) -> None:
    light = torch.rand(8, 12, dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(lambda image: StrayLight(0.4, 0.2).image(image, ideal, geometry), light)


def test_it_acts_on_the_light_and_is_listed(ideal: Profile, phase: Tensor) -> None:
    veiled = replace(ideal, stray_light=StrayLight(0.5, 0.3))
    clear, dim = (SimulatedBench(profile).integrated(phase[1], 1) for profile in (ideal, veiled))
    assert torch.allclose(dim, 0.5 * clear + 0.5 * gaussian(clear, 0.3 * clear.shape[0]), atol=1e-5)
    assert "50 %" in next(effect.text for effect in veiled.effects() if effect.name == "stray_light")
    assert "stray_light" not in {effect.name for effect in ideal.effects()}


def test_any_number_of_threads_gives_the_same_veil() -> None:
    light = torch.rand(540, 960, generator=torch.Generator().manual_seed(1))
    once = gaussian(light, 5.4)
    for threads in (2, 3):
        torch.set_num_threads(threads)
        again = gaussian(light, 5.4)
        torch.set_num_threads(1)
        assert torch.equal(once, again)
