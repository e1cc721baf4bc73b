from __future__ import annotations

import pytest
import torch
from torch import Tensor

from holobench_eval.metrics import match
from holobench_eval.metrics.error_budget import temporal, unexplained


def picture(seed: int, side: int = 64) -> Tensor:
    draw = torch.Generator().manual_seed(seed)
    coarse = torch.rand((1, 3, 8, 8), generator=draw)
    return torch.nn.functional.interpolate(coarse, (side, side), mode="bilinear")[0].double()


def noise(seed: int, deviation: float, side: int = 64) -> Tensor:
    draw = torch.Generator().manual_seed(seed)
    return deviation * torch.randn((3, side, side), generator=draw, dtype=torch.float64)


@pytest.mark.parametrize("lit", [(1, 1, 1), (1, 0, 1), (0, 1, 0)])
def test_what_the_target_leaves_is_the_error_of_the_protocol_before_its_clip(lit: tuple[int, ...]) -> None:
    target = picture(0) * torch.tensor(lit).view(3, 1, 1)
    capture = 3 * (target + noise(1, 0.05))
    _, factors = match(capture, target)
    protocol = (factors.view(-1, 1, 1) * capture - target).square().mean()
    assert unexplained(capture, target, target) == pytest.approx(float(protocol), rel=1e-9)


def test_brightness_changes_nothing_and_a_prediction_in_another_unit_explains_as_much() -> None:
    target, capture, prediction = picture(0), picture(1), picture(2)
    units = torch.tensor([0.1, 2.0, 30.0]).view(3, 1, 1)
    left = unexplained(capture, prediction, target)
    assert unexplained(units * capture, prediction / units, target) == pytest.approx(left, rel=1e-9)


def test_unpredictable_noise_leaves_the_same_whether_the_target_or_the_model_predicts() -> None:
    # matched by least squares, a noisy capture is dimmed: that must not count as something to be explained
    target = picture(0)
    capture = target + noise(1, 0.3)
    assert unexplained(capture, 0.5 * target, target) == pytest.approx(unexplained(capture, target, target), rel=1e-9)


@pytest.mark.parametrize("deviation", [0.01, 0.3])
def test_two_captures_tell_what_the_noise_free_picture_leaves(deviation: float) -> None:
    target, free = picture(0, 256), picture(5, 256)
    first, second = (free + noise(seed, deviation, 256) for seed in (1, 2))
    assert temporal(first, second, target) == pytest.approx(unexplained(first, free, target), rel=0.02)


def test_a_picture_explains_itself_and_a_black_one_nothing() -> None:
    target, capture = picture(0), picture(1)
    power = float(target.square().mean())
    assert unexplained(capture, capture, target) == pytest.approx(0, abs=1e-12)
    assert unexplained(capture, torch.zeros_like(capture), target) == pytest.approx(power)
    assert unexplained(torch.zeros_like(capture), capture, target) == pytest.approx(power)
    assert unexplained(capture, -capture, target) == pytest.approx(power)
