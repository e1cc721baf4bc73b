"""SSIM and MS-SSIM equal the implementations that define them, and follow from their formula."""

from __future__ import annotations

from collections.abc import Callable

import pytest
import torch
from skimage.metrics import structural_similarity
from torch import Tensor
from torchmetrics.functional.image import multiscale_structural_similarity_index_measure

from holobench_eval.core import compiled
from holobench_eval.metrics.ms_ssim import ms_ssim
from holobench_eval.metrics.psnr import psnr
from holobench_eval.metrics.ssim import C1, ssim

Photograph = Callable[..., Tensor]
Metric = Callable[[Tensor, Tensor], Tensor]


def noisy(image: Tensor, sigma: float) -> Tensor:
    noise = torch.randn(image.shape, generator=torch.Generator().manual_seed(5), dtype=image.dtype)
    return (image + sigma * noise).clamp(0, 1)


@pytest.mark.parametrize(("height", "width"), [(11, 11), (12, 37), (64, 101)])
@pytest.mark.parametrize("sigma", [0.0, 0.05, 0.5])
def test_ssim_equals_scikit_image(photograph: Photograph, height: int, width: int, sigma: float) -> None:
    target = photograph("coffee", 128)[:, :height, :width]
    image = noisy(target, sigma)
    given = structural_similarity(
        image.numpy(),
        target.numpy(),
        gaussian_weights=True,
        sigma=1.5,
        use_sample_covariance=False,
        data_range=1,
        channel_axis=0,
    )
    assert float(ssim(image, target)) == pytest.approx(given, abs=1e-12)


def test_ssim_of_a_large_image_equals_scikit_image_whatever_the_number_of_threads() -> None:
    draw = torch.Generator().manual_seed(6)
    target = torch.rand(2, 3, 240, 1100, generator=draw, dtype=torch.float64)  # more than one strip
    image = noisy(target, 0.1)
    before, found = torch.get_num_threads(), []
    for threads in (1, 2, 3):
        torch.set_num_threads(threads)
        found.append(ssim(image, target))
    torch.set_num_threads(before)
    assert torch.equal(found[0], found[1])
    assert torch.equal(found[0], found[2])
    for value, *pair in zip(found[0], image, target, strict=True):
        known = {"gaussian_weights": True, "sigma": 1.5, "use_sample_covariance": False, "data_range": 1}
        given = structural_similarity(*(side.numpy() for side in pair), channel_axis=0, **known)
        assert float(value) == pytest.approx(given, abs=1e-12)


@pytest.mark.parametrize("metric", [ssim, ms_ssim])
def test_the_value_is_the_same_without_numba(
    photograph: Photograph, metric: Metric, monkeypatch: pytest.MonkeyPatch
) -> None:
    target = photograph("coffee", 192)
    image = noisy(target, 0.1)
    value, single = float(metric(image, target)), float(metric(image.float(), target.float()))
    monkeypatch.setattr(compiled, "AVAILABLE", False)
    assert float(metric(image, target)) == pytest.approx(value, abs=1e-12)
    assert float(metric(image.float(), target.float())) == pytest.approx(single, abs=2e-6)


@pytest.mark.parametrize("metric", [ssim, ms_ssim])
def test_the_value_is_the_same_where_a_gradient_is_wanted(photograph: Photograph, metric: Metric) -> None:
    target = photograph("coffee", 192)
    image = noisy(target, 0.1).requires_grad_()
    assert float(metric(image, target).detach()) == pytest.approx(float(metric(image.detach(), target)), abs=1e-12)


@pytest.mark.parametrize(("height", "width"), [(176, 176), (183, 190)])
@pytest.mark.parametrize("channels", [1, 3])
def test_ms_ssim_equals_torchmetrics(photograph: Photograph, height: int, width: int, channels: int) -> None:
    target = photograph("chelsea", channels=channels)[:, :height, :width]
    image = noisy(target, 0.1)
    given = multiscale_structural_similarity_index_measure(image[None], target[None], data_range=1.0)
    # torchmetrics keeps the exponents in single precision.
    assert float(ms_ssim(image, target)) == pytest.approx(float(given), abs=1e-8)


def test_ms_ssim_of_a_negative_is_zero_and_not_nan(photograph: Photograph) -> None:
    target = photograph("chelsea")
    assert float(ms_ssim(1 - target, target)) == 0.0


def test_ssim_of_two_flat_images_is_the_luminance_term() -> None:
    a, b = torch.full((1, 32, 32), 0.2, dtype=torch.float64), torch.full((1, 32, 32), 0.6, dtype=torch.float64)
    assert float(ssim(a, b)) == pytest.approx((2 * 0.2 * 0.6 + C1) / (0.2**2 + 0.6**2 + C1), abs=1e-12)


def test_psnr_of_a_known_error() -> None:
    target = torch.full((3, 8, 8), 0.5, dtype=torch.float64)
    assert float(psnr(target + 0.1, target)) == pytest.approx(20.0, abs=1e-5)
    assert float(psnr(target, target)) == pytest.approx(80.0)
