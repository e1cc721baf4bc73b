"""Single metrics equal their formulas and references, and are what they say."""

import math
from collections.abc import Callable

import pytest
import torch
from skimage.metrics import structural_similarity
from torch import Tensor
from torchmetrics.functional.image import multiscale_structural_similarity_index_measure

from holobench_eval.core import compiled
from holobench_eval.metrics import feature_distance, flip, haarpsi, match
from holobench_eval.metrics.base import gaussian_blur
from holobench_eval.metrics.control import CHANGES, COLUMNS, MOST, control
from holobench_eval.metrics.error_budget import temporal, unexplained
from holobench_eval.metrics.feature_distance import FixedMofd, mofd
from holobench_eval.metrics.ms_ssim import FixedMsSsim, ms_ssim
from holobench_eval.metrics.psnr import psnr
from holobench_eval.metrics.speckle import speckle_contrast
from holobench_eval.metrics.ssim import C1, ssim
from holobench_eval.optics.colour import srgb_decode, srgb_encode

Photograph = Callable[..., Tensor]


def noisy(image: Tensor, sigma: float) -> Tensor:
    noise = torch.randn(image.shape, generator=torch.Generator().manual_seed(5), dtype=image.dtype)
    return (image + sigma * noise).clamp(0, 1)


def of_scikit_image(image: Tensor, target: Tensor) -> float:
    known = {"gaussian_weights": True, "sigma": 1.5, "use_sample_covariance": False, "data_range": 1}
    return structural_similarity(image.numpy(), target.numpy(), channel_axis=0, **known)


@pytest.mark.parametrize(("height", "width"), [(11, 11), (12, 37), (64, 101)])
@pytest.mark.parametrize("sigma", [0.0, 0.05, 0.5])
def test_ssim_equals_scikit_image(photograph: Photograph, height: int, width: int, sigma: float) -> None:
    target = photograph("coffee", 128)[:, :height, :width]
    image = noisy(target, sigma)
    assert float(ssim(image, target)) == pytest.approx(of_scikit_image(image, target), abs=1e-12)


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
        assert float(value) == pytest.approx(of_scikit_image(*pair), abs=1e-12)


@pytest.mark.parametrize("metric", [ssim, ms_ssim])
def test_the_value_is_the_same_without_numba_and_with_a_gradient(photograph: Photograph, metric, monkeypatch) -> None:
    target = photograph("coffee", 192)
    image = noisy(target, 0.1)
    graph = metric(image.clone().requires_grad_(), target)
    assert float(graph.detach()) == pytest.approx(float(metric(image, target)), abs=1e-12)
    value, single = float(metric(image, target)), float(metric(image.float(), target.float()))
    monkeypatch.setattr(compiled, "AVAILABLE", False)
    assert float(metric(image, target)) == pytest.approx(value, abs=1e-12)
    assert float(metric(image.float(), target.float())) == pytest.approx(single, abs=2e-6)


@pytest.mark.parametrize(("height", "width"), [(176, 176), (183, 190)])
@pytest.mark.parametrize("channels", [1, 3])
def test_ms_ssim_equals_torchmetrics(photograph: Photograph, height: int, width: int, channels: int) -> None:
    target = photograph("chelsea", channels=channels)[:, :height, :width]
    image = noisy(target, 0.1)
    given = multiscale_structural_similarity_index_measure(image[None], target[None], data_range=1.0)
    # torchmetrics keeps the exponents in single precision.
    assert float(ms_ssim(image, target)) == pytest.approx(float(given), abs=1e-8)


def test_values_that_follow_from_the_formulas(photograph: Photograph) -> None:
    target = photograph("chelsea")
    assert float(ms_ssim(1 - target, target)) == 0.0
    a, b = torch.full((1, 32, 32), 0.2, dtype=torch.float64), torch.full((1, 32, 32), 0.6, dtype=torch.float64)
    assert float(ssim(a, b)) == pytest.approx((2 * 0.2 * 0.6 + C1) / (0.2**2 + 0.6**2 + C1), abs=1e-12)
    target = torch.full((3, 8, 8), 0.5, dtype=torch.float64)
    assert float(psnr(target + 0.1, target)) == pytest.approx(20.0, abs=1e-5)
    assert float(psnr(target, target)) == pytest.approx(80.0)


def _random(kind: str, shape: torch.Size) -> Tensor:
    generator = torch.Generator().manual_seed(9)
    if kind == "noise":
        return torch.randn(shape, generator=generator, dtype=torch.float64)
    return -torch.log1p(-torch.rand(shape, generator=generator, dtype=torch.float64))


SERIES: dict[str, list[Callable[[Tensor], Tensor]]] = {
    "blur": [lambda s, q=q: gaussian_blur(s[None], q)[0] for q in (0.5, 1.0, 2.0, 4.0)],
    "noise": [lambda s, q=q: (s + q * _random("noise", s.shape)).clamp(0, 1) for q in (0.01, 0.02, 0.05, 0.1, 0.2)],
    "speckle": [
        lambda s, q=q: srgb_encode(srgb_decode(s) * (1 + q * (_random("speckle", s.shape) - 1)))
        for q in (0.1, 0.25, 0.5, 1.0)
    ],
    "shift": [lambda s, q=q: torch.roll(s, q, dims=-1) for q in (1, 2, 3, 4, 6, 8)],
    "contrast": [lambda s, q=q: 0.5 + q * (s - 0.5) for q in (0.9, 0.75, 0.5, 0.25, 0.0)],
    "dimming": [lambda s, q=q: q * s for q in (0.9, 0.75, 0.5, 0.25, 0.0)],
}


@pytest.mark.parametrize("picture", ["astronaut", "camera", "grass"])
@pytest.mark.parametrize("kind", SERIES)
def test_a_stronger_distortion_is_further_away(photograph: Photograph, picture: str, kind: str) -> None:
    target = photograph(picture, 128)
    distances = [float(mofd(distort(target), target)) for distort in SERIES[kind]]
    assert distances == sorted(distances)
    assert 0 < distances[0] < 0.8 * distances[-1]
    assert 0.05 < distances[-1] <= 1


def test_colour_noise_is_seen_and_unrelated_pictures_are_further_apart_than_half_speckled_ones(photograph) -> None:
    target = 0.2 + 0.6 * photograph("coffee", 128)
    noise = 0.1 * _random("noise", target[:1].shape)
    image = (target + torch.cat([noise, -noise * 0.299 / 0.587, torch.zeros_like(noise)])).clamp(0, 1)
    assert float(mofd(image, target)) > 0.01
    target, other = photograph("chelsea", 128), photograph("rocket", 128)
    speckled = SERIES["speckle"][2](target)
    assert float(mofd(other, target)) > 2 * float(mofd(speckled, target))


@pytest.mark.parametrize(("fixed", "plain"), [(FixedMofd, mofd), (FixedMsSsim, ms_ssim)])
def test_a_fixed_target_serves_many_images_with_the_plain_values(photograph, fixed, plain) -> None:
    target = photograph("coffee")
    measure = fixed(target)
    for distort in SERIES["noise"][:2]:
        assert torch.equal(measure(distort(target)), plain(distort(target), target))
    with pytest.raises(ValueError, match="differ in shape"):
        measure(target[:, 1:])


def test_fully_developed_speckle_has_contrast_one_and_even_light_zero() -> None:
    target = torch.full((3, 128, 128), 0.4, dtype=torch.float64)
    uniform = torch.rand(target.shape, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    assert speckle_contrast(-torch.log1p(-uniform), target) == pytest.approx(1.0, abs=0.02)
    assert speckle_contrast(7 * target, target) == 0.0


def test_only_flat_and_lit_patches_count() -> None:
    target = torch.full((1, 16, 64), 0.5, dtype=torch.float64)
    target[..., 16:32] = torch.linspace(0, 1, 16)  # a ramp
    target[..., 32:48] = 0.01  # too dark
    capture = target.clone()
    capture[..., 16:48] = torch.rand(16, 32, generator=torch.Generator().manual_seed(1), dtype=torch.float64)
    capture[..., 48:56] = 0.25
    capture[..., 56:64] = 0.75
    assert speckle_contrast(capture, target) == pytest.approx((0.0 + 0.5) / 2)


def test_without_a_patch_there_is_no_number_and_wrong_input_is_refused() -> None:
    ramp = torch.linspace(0, 1, 64, dtype=torch.float64).expand(1, 64, 64)
    assert math.isnan(speckle_contrast(ramp, ramp))
    flat = torch.full((1, 64, 64), 0.5)
    assert math.isnan(speckle_contrast(torch.zeros_like(flat), flat))
    flat = torch.full((1, 32, 32), 0.5)
    with pytest.raises(ValueError, match="expected"):
        speckle_contrast(flat, flat[:, :16])
    with pytest.raises(ValueError, match="at least 16"):
        speckle_contrast(flat[:, :8], flat[:, :8])
    with pytest.raises(ValueError, match="finite"):
        speckle_contrast(flat * math.nan, flat)


UNIT = torch.tensor([0.1, 2.0, 30.0]).view(3, 1, 1)


def random_picture(name: int) -> Tensor:
    return torch.rand((3, 32, 32), generator=torch.Generator().manual_seed(name), dtype=torch.float64)


def answered(model: float) -> dict[str, float]:
    """Of a model that predicts the unchanged picture and this share of each change."""
    before = random_picture(0)
    after = {change: random_picture(k) for k, change in enumerate(CHANGES, start=1)}
    changed = {name: (one, UNIT * (before + model * (one - before))) for name, one in after.items()}
    return control(before, before, UNIT * before, changed)


@pytest.mark.parametrize(("model", "expected"), [(1, 1), (0, 0), (0.5, 0.75), (-1, -3), (2, 0)])
def test_control_is_one_less_the_squared_error_of_the_answer_whatever_the_unit(model: float, expected: float) -> None:
    found = answered(model)
    assert {*found} == {*COLUMNS}
    assert found.pop(MOST) == 1
    assert list(found.values()) == pytest.approx([expected] * len(found), abs=1e-9)


def test_a_change_of_brightness_is_part_of_the_answer() -> None:
    before = random_picture(0)
    assert control(before, before, before, {"half": (2 * before, 2 * before)})["control_half"] == pytest.approx(1)
    assert control(before, before, before, {"half": (2 * before, before)})["control_half"] == pytest.approx(0)


def test_a_perfect_model_lacks_what_the_noise_of_both_captures_takes_and_a_second_capture_tells() -> None:
    before, after = 4 * random_picture(0), 4 * random_picture(1)
    noise = [0.5 * torch.randn(before.shape, generator=torch.Generator().manual_seed(9 + k)) for k in range(3)]
    found = control(before + noise[0], before + noise[1], before, {"patch": (after + noise[2], after)})
    assert found["control"] == pytest.approx(found[MOST], abs=0.01)
    assert found[MOST] < 0.9


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


def test_brightness_and_unpredictable_noise_change_nothing() -> None:
    target, capture, prediction = picture(0), picture(1), picture(2)
    units = torch.tensor([0.1, 2.0, 30.0]).view(3, 1, 1)
    left = unexplained(capture, prediction, target)
    assert unexplained(units * capture, prediction / units, target) == pytest.approx(left, rel=1e-9)
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


PAIR = [
    torch.rand(3, 150, 130, dtype=torch.float64, generator=torch.Generator().manual_seed(seed)).mul(0.3).add(0.1 * seed)
    for seed in (1, 2)
]


@pytest.mark.parametrize("channels", [1, 3])
@pytest.mark.parametrize(("module", "name"), [(feature_distance, "mofd"), (flip, "flip"), (haarpsi, "haarpsi")])
def test_the_score_of_strips_is_that_of_the_image(monkeypatch, module, name, channels):
    pair = [side[:channels] for side in PAIR]
    entire = getattr(module, name)(*pair)
    monkeypatch.setattr(module, "LARGEST_AT_ONCE", 1000, raising=False)
    monkeypatch.setattr(module, "STRIP", 130 * 40)
    # The package flip-evaluator adds 20,000 errors in single precision.
    assert float(getattr(module, name)(*pair)) == pytest.approx(float(entire), rel=1e-5 if name == "flip" else 1e-12)
