"""What the metrics share: features of a target that are kept, and Gaussian filters."""

from __future__ import annotations

import sys
from concurrent.futures import ThreadPoolExecutor

import pytest
import torch
from torch import Tensor

from holobench_eval.imaging.shifts import correlate
from holobench_eval.metrics.base import (
    block_means,
    gaussian_blur,
    gaussian_taps,
    gaussian_valid,
    gradient_magnitude,
    halved,
    remembered,
)


def test_a_result_is_kept_by_what_the_image_shows_and_the_oldest_goes_first() -> None:
    asked: list[float] = []

    def doubled(image: Tensor) -> Tensor:
        asked.append(float(image.detach().max()))
        return 2 * image

    known = remembered(doubled, most=2)
    images = [torch.full((1, 1, 4, 4), value, dtype=torch.float64) for value in (0.1, 0.2, 0.3)]
    for image in (*images[:2], images[0].clone(), images[2], images[0], images[1]):
        assert torch.equal(known(image), 2 * image)
    assert asked == [0.1, 0.2, 0.3, 0.2]
    images[1][0, 0, 0, 0] = 1.0  # the same tensor, another picture
    assert torch.equal(known(images[1]), 2 * images[1])
    assert known(images[0].float()).dtype == torch.float32
    assert known(images[0].reshape(1, 1, 2, 8)).shape == (1, 1, 2, 8)


def test_of_a_large_image_nothing_is_kept() -> None:
    asked: list[int] = []

    def counted(image: Tensor) -> int:
        asked.append(image.numel())
        return image.numel()

    known = remembered(counted)
    for side in (512, 513):
        assert known(torch.zeros(1, 1, side, side)) == known(torch.zeros(1, 1, side, side)) == side**2
    assert asked == [512**2, 513**2, 513**2]


def test_with_a_gradient_nothing_is_kept() -> None:
    known = remembered(torch.square)
    known(torch.ones(1, 1, 4, 4))
    image = torch.ones(1, 1, 4, 4, requires_grad=True)
    known(image).sum().backward()
    assert torch.equal(image.grad, torch.full((1, 1, 4, 4), 2.0))
    assert not known(torch.ones(1, 1, 4, 4)).requires_grad


def test_threads_that_ask_for_different_images_get_their_own_results() -> None:
    known = remembered(lambda image: float(image.max()), most=2)
    images = [torch.full((1, 1, 4, 4), float(value)) for value in range(12)]
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        with ThreadPoolExecutor(4) as pool:
            assert list(pool.map(known, images * 50)) == list(range(12)) * 50
    finally:
        sys.setswitchinterval(before)


def test_what_was_asked_for_in_inference_mode_can_be_differentiated_later() -> None:
    known = remembered(torch.square)
    with torch.inference_mode():
        known(torch.full((1, 1, 4, 4), 3.0))
    weight = torch.ones(1, requires_grad=True)
    (weight * known(torch.full((1, 1, 4, 4), 3.0))).sum().backward()
    assert weight.grad == 16 * 9


def test_a_gaussian_filter_is_the_sum_of_shifted_images_and_so_is_its_gradient() -> None:
    draw, taps = torch.Generator().manual_seed(1), gaussian_taps(1.5, 3)
    image = torch.rand(2, 3, 11, 13, dtype=torch.float64, generator=draw).requires_grad_()
    weights = torch.rand(2, 3, 5, 7, dtype=torch.float64, generator=draw)
    filtered, expected = gaussian_valid(image, 1.5, 3), correlate(correlate(image, taps, -1), taps, -2)
    assert torch.allclose(filtered, expected, rtol=1e-12)
    gradients = [torch.autograd.grad((weights * each).sum(), image)[0] for each in (filtered, expected)]
    assert torch.allclose(*gradients, rtol=1e-12)


@pytest.mark.parametrize(("height", "width"), [(4, 6), (4, 5), (5, 4), (5, 7)])
def test_halving_averages_four_pixels_and_pads_an_odd_side_with_zeros(height: int, width: int) -> None:
    image = torch.rand(2, 3, height, width, generator=torch.Generator().manual_seed(0))
    padded = torch.zeros(2, 3, height + height % 2, width + width % 2)
    padded[..., :height, :width] = image
    four = (padded[..., i::2, j::2] for i in (0, 1) for j in (0, 1))
    assert torch.allclose(halved(image), sum(four, torch.zeros(())) / 4)


def test_block_means_leave_out_what_fills_no_block() -> None:
    image = torch.rand(1, 2, 7, 6, generator=torch.Generator().manual_seed(0))
    expected = image[..., :6, :6].reshape(1, 2, 2, 3, 2, 3).mean((3, 5))
    assert torch.allclose(block_means(image, 3), expected)
    assert torch.equal(block_means(image, 1), image)


def test_a_gradient_has_the_weights_of_its_operator() -> None:
    edge = torch.zeros(1, 1, 5, 6)
    edge[..., 3:] = 1
    ramp = torch.arange(5.0)[:, None].expand(1, 1, 5, 6)
    for kernel in ("prewitt", "scharr"):
        assert gradient_magnitude(edge, kernel)[0, 0, 2].tolist() == pytest.approx([0, 0, 1, 1, 0, 1], abs=1e-6)
        assert torch.allclose(gradient_magnitude(ramp, kernel)[..., 1:-1, 1:-1], torch.tensor(2.0))


def test_a_blur_keeps_even_light_and_spreads_a_point_by_its_width() -> None:
    assert torch.allclose(gaussian_blur(torch.full((1, 1, 20, 30), 0.7), 2.0), torch.tensor(0.7))
    point = torch.zeros(1, 1, 41, 41, dtype=torch.float64)
    point[..., 20, 20] = 1
    soft = gaussian_blur(point, 1.5)[0, 0]
    distance = torch.arange(41) - 20
    assert float(soft.sum()) == pytest.approx(1)
    assert float((soft.sum(0) * distance**2).sum()) == pytest.approx(1.5**2, rel=0.01)
    assert float(soft[20, 26]) > 0
    assert float(soft[20, 27]) == 0  # cut off at 4 sigma
