"""The rules of the protocol: intensity match, domains, refinement, blur, subsets, absent columns."""

import math
from collections.abc import Callable
from pathlib import Path

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch import Tensor

from holobench_eval.core.errors import UserError
from holobench_eval.metrics import catalogue, match, score
from holobench_eval.metrics.base import gaussian_blur
from holobench_eval.metrics.psnr import psnr
from holobench_eval.metrics.ssim import ssim
from holobench_eval.optics.colour import srgb_decode, srgb_encode

Photograph = Callable[..., Tensor]
QUICK = ("psnr", "ssim")


@pytest.fixture
def target(photograph: Photograph) -> Tensor:
    return srgb_decode(photograph("astronaut", 176))


@pytest.fixture
def capture(target: Tensor) -> Tensor:
    """Speckled, in other units, with noise below zero, dimmer in some channels than in others."""
    generator = torch.Generator().manual_seed(2)
    speckle = 1 + 0.5 * torch.rand(target.shape, generator=generator, dtype=torch.float64)
    noise = 0.01 * torch.randn(target.shape, generator=generator, dtype=torch.float64)
    return (target * speckle + noise) * torch.tensor([3.0, 0.7, 11.0]).view(3, 1, 1)


def test_match_is_the_least_squares_factor_of_each_channel(capture: Tensor, target: Tensor) -> None:
    image, factors = match(capture, target)
    for channel in range(3):
        column = capture[channel].reshape(-1, 1)
        expected = torch.linalg.lstsq(column, target[channel].reshape(-1, 1)).solution
        assert float(factors[channel]) == pytest.approx(float(expected), rel=1e-9)
    assert torch.allclose(image, (factors.view(3, 1, 1) * capture).clamp(0, 1))


def test_a_black_channel_stays_black_with_factor_zero_and_a_black_capture_has_finite_scores(target: Tensor) -> None:
    dark = target.clone()
    dark[1] = 0
    image, factors = match(dark, target)
    assert float(factors[1]) == 0.0
    assert not bool(image[1].any())
    assert bool(image.isfinite().all())
    scores = score(torch.zeros_like(target), target)
    assert all(math.isfinite(value) for value in scores.values())
    assert scores["brightness_ratio"] == 0.0
    assert "speckle_contrast" not in scores


@settings(max_examples=15, deadline=None)
@given(st.floats(1e-30, 1e30))
def test_scores_do_not_depend_on_the_unit_of_the_capture(gain: float) -> None:
    generator = torch.Generator().manual_seed(6)
    target = torch.rand(1, 32, 32, generator=generator, dtype=torch.float64)
    capture = target + 0.3 * torch.rand(target.shape, generator=generator, dtype=torch.float64)
    plain, scaled = (score(k * capture, target, metrics=QUICK, refine=False) for k in (1.0, gain))
    scaled["scale_0"] *= gain
    scaled["brightness_ratio"] /= gain
    assert scaled == pytest.approx(plain, rel=1e-9)


def test_every_score_is_independent_of_the_gain_of_each_channel(capture: Tensor, target: Tensor) -> None:
    gains = torch.tensor([0.25, 4.0, 32.0]).view(3, 1, 1)
    plain, scaled = score(capture, target), score(gains * capture, target)
    for column, value in plain.items():
        if column != "brightness_ratio" and not column.startswith("scale_"):
            assert scaled[column] == pytest.approx(value, rel=1e-6, abs=1e-9), column


def test_domains_are_the_named_encodings_of_the_matched_image(capture: Tensor, target: Tensor) -> None:
    scores = score(capture, target, metrics=QUICK)
    image, _ = match(capture, target)
    for name, function in (("psnr", psnr), ("ssim", ssim)):
        for domain, encode in (("linear", torch.clone), ("amplitude", torch.sqrt), ("srgb", srgb_encode)):
            assert scores[f"{name}_{domain}"] == pytest.approx(float(function(encode(image), encode(target))), rel=1e-9)


def test_all_columns_are_there_and_finite(capture: Tensor, target: Tensor, random_alexnet: Path) -> None:
    scores = score(capture, target, lpips_weights=random_alexnet)
    assert all(math.isfinite(value) for value in scores.values())
    full_reference = {f"{m.name}_{domain}" for m in catalogue() for domain in m.domains if m.name != "lpips_vgg"}
    repeated = {f"{name}_linear_{tail}" for name in QUICK for tail in ("refined", "blur0.5", "blur1")}
    described = {"refine_dx_px", "refine_dy_px", "refine_theta_deg", "brightness_ratio"}
    described |= {f"scale_{channel}" for channel in range(3)}
    judged = full_reference | repeated | {"speckle_contrast"}
    assert set(scores) == judged | described


@pytest.mark.parametrize("unit", [1e-30, 1e30])
@pytest.mark.parametrize("leak", [0.0, 1.0, 10.0])
def test_light_where_the_target_is_black_is_an_error_at_the_factor_of_lit_colours(capture, target, leak, unit) -> None:
    red = target * torch.tensor([1.0, 0.0, 0.0]).view(3, 1, 1)
    shown = capture.clone()
    shown[1:] = leak * shown[0]
    factor = float((shown[0] * red[0]).sum() / shown[0].square().sum())
    wrong = float(((factor * shown).clamp(0, 1) - red).square().mean())
    scores = score(unit * shown, red, metrics=("psnr",))
    assert scores["psnr_linear"] == pytest.approx(-10 * math.log10(wrong), abs=1e-4)
    assert [scores[f"scale_{channel}"] * unit for channel in range(3)] == pytest.approx([factor] * 3, rel=1e-9)


def test_two_colours_with_light_give_a_black_one_their_mean_factor(capture: Tensor, target: Tensor) -> None:
    wanted = target * torch.tensor([1.0, 0.0, 1.0]).view(3, 1, 1)
    _, factors = match(capture, wanted)
    own = (capture * wanted).sum((1, 2)) / capture.square().sum((1, 2))
    light = wanted.mean((1, 2))
    assert torch.allclose(factors[[0, 2]], own[[0, 2]], rtol=1e-12, atol=0)
    assert float(factors[1]) == pytest.approx(float((light * own).sum() / light.sum()), rel=1e-12)
    assert min(own[0], own[2]) < factors[1] < max(own[0], own[2])


@pytest.mark.parametrize("part", [0.02, 0.04, 0.0500001])
def test_a_colour_below_a_twentieth_of_the_brightest_has_its_own_factor_in_proportion(capture, target, part) -> None:
    light = target.mean((1, 2), keepdim=True)
    dim = target * torch.tensor([1.0, part, part]).view(3, 1, 1) * light[0] / light
    _, factors = match(capture, dim)
    own = (capture * dim).sum((1, 2)) / capture.square().sum((1, 2))
    weights = dim.mean((1, 2))
    common, share = weights @ own / weights.sum(), min(part / 0.05, 1)
    assert torch.allclose(factors[1:], share * own[1:] + (1 - share) * common, rtol=1e-6, atol=0)


def test_one_colour_has_the_score_of_the_same_picture_in_three_equal_ones(capture: Tensor, target: Tensor) -> None:
    one, three = ((capture[:1].expand(n, -1, -1), target[:1].expand(n, -1, -1)) for n in (1, 3))
    alone, gray = score(*one, metrics=QUICK), score(*three, metrics=QUICK)
    assert {name: gray[name] for name in alone} == pytest.approx(alone, abs=1e-6)
    assert set(gray) - set(alone) == {"scale_1", "scale_2"}


def test_brightness_ratio_is_taken_before_the_match_and_the_smallest_region_is_scored(target, capture) -> None:
    scores = score(4 * target, target, metrics=("psnr",), refine=False, blur=())
    assert scores["brightness_ratio"] == pytest.approx(4.0)
    assert scores["scale_2"] == pytest.approx(0.25)
    assert len(scores) == 3 + 1 + 3
    scores = score(capture[:, :16, :16], target[:, :16, :16], metrics=("psnr",), refine=False, blur=(3.7,))
    assert math.isfinite(scores["psnr_linear_blur3.7"])
    with pytest.raises(ValueError, match="less than a quarter"):
        score(capture[:, :16, :16], target[:, :16, :16], metrics=("psnr",), refine=False, blur=(3.75,))


def test_refinement_finds_a_shift_and_reports_it(photograph: Photograph) -> None:
    large = srgb_decode(photograph("coffee", 200))
    target, capture = large[:, 10:190, 10:190], large[:, 10:190, 9:189]
    scores = score(capture, target, metrics=QUICK, blur=())
    assert scores["refine_dx_px"] == pytest.approx(1.0, abs=0.05)
    assert scores["refine_dy_px"] == pytest.approx(0.0, abs=0.05)
    assert scores["psnr_linear_refined"] > scores["psnr_linear"] + 10


def test_blur_is_applied_to_both_before_the_match(capture: Tensor, target: Tensor) -> None:
    scores = score(capture, target, metrics=("psnr",), blur=(2.0,))
    soft_capture, soft_target = (gaussian_blur(side[None], 2.0)[0] for side in (capture, target))
    image, _ = match(soft_capture, soft_target)
    assert scores["psnr_linear_blur2"] == pytest.approx(float(psnr(image, soft_target)))


def test_numpy_and_single_precision_are_accepted_and_a_small_region_has_fewer_columns(capture, target) -> None:
    tensors = score(capture.float(), target.float(), metrics=QUICK)
    arrays = score(capture.float().numpy(), target.float().numpy(), metrics=QUICK)
    assert arrays == tensors
    scores = score(capture[:, :48, :48], target[:, :48, :48])
    assert "psnr_linear" in scores
    assert "haarpsi_srgb" in scores
    assert not any(column.startswith(("ms_ssim", "mofd")) for column in scores)


@pytest.mark.parametrize("spoil", [math.nan, math.inf])
def test_values_that_are_not_finite_are_errors(capture: Tensor, target: Tensor, spoil: float) -> None:
    broken = capture.clone()
    broken[2, 3, 4] = spoil
    with pytest.raises(ValueError, match="not finite"):
        score(broken, target)
    broken = target.clone()
    broken[2, 3, 4] = spoil
    with pytest.raises(ValueError, match="target values"):
        score(capture, broken)


@pytest.mark.parametrize("side", [0, 1])
def test_integers_may_be_levels_or_counts_and_are_refused(target: Tensor, side: int) -> None:
    pair = [target, target]
    pair[side] = (255 * target).byte()
    for sides in (pair, [tensor.numpy() for tensor in pair]):
        with pytest.raises(ValueError, match=r"is of torch\.uint8; expected linear light as floating point"):
            score(*sides)


def test_wrong_shapes_ranges_and_names_are_errors(capture: Tensor, target: Tensor, tmp_path: Path) -> None:
    with pytest.raises(UserError, match="no trunk weights"):
        score(capture, target, lpips_weights=tmp_path)
    with pytest.raises(UserError, match="no such file"):
        score(capture, target, lpips_weights=str(tmp_path / "absent"))
    with pytest.raises(ValueError, match="must both be"):
        score(capture[:, 1:], target)
    with pytest.raises(ValueError, match="at least 16"):
        score(capture[:, :9], target[:, :9])
    with pytest.raises(ValueError, match="target values"):
        score(capture, 255 * target)
    with pytest.raises(ValueError, match="the target is black; expected light in at least one of its colours"):
        score(capture, torch.zeros_like(target))
    with pytest.raises(ValueError, match=r"the target has at most 0\.001 of white"):
        score(capture, 1e-3 * target / target.max())
    with pytest.raises(ValueError, match="blur width"):
        score(capture, target, metrics=QUICK, blur=(0.0,))
    with pytest.raises(UserError, match="did you mean 'psnr'"):
        score(capture, target, metrics=("psrn",))


def test_stored_values_are_compared_as_they_are_and_named_so(capture: Tensor, target: Tensor) -> None:
    found = score(capture, target, metrics=QUICK, stored=True)
    light = score(capture, target, metrics=QUICK)
    assert not any(domain in key for key in found for domain in ("linear", "amplitude", "srgb"))
    assert found["psnr_stored"] == light["psnr_linear"]  # the same numbers, without a claim that they are light
    assert found["ssim_stored_blur1"] == light["ssim_linear_blur1"]
    assert "speckle_contrast" not in score(capture, target, refine=False, blur=(), stored=True)
