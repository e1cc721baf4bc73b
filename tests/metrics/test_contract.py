"""What every metric promises: best value for equal images, symmetry, checks of its input, finite values, gradients."""

import math
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
import torch
from torch import Tensor

from holobench_eval.imaging.shifts import correlate
from holobench_eval.metrics import Metric, base, catalogue, floor_captures, score
from holobench_eval.optics.colour import srgb_decode

NAMES = [metric.name for metric in catalogue() if metric.name != "lpips_vgg"]
Photograph = Callable[..., Tensor]


@pytest.fixture(params=NAMES)
def metric(request: pytest.FixtureRequest, random_alexnet: Path) -> Metric:
    return next(metric for metric in catalogue(random_alexnet) if metric.name == request.param)


@pytest.fixture(params=[1, 3], ids=["gray", "colour"])
def pair(request: pytest.FixtureRequest, photograph: Photograph) -> tuple[Tensor, Tensor]:
    """A noisy photograph and the photograph, away from the ends of the range."""
    target = 0.15 + 0.7 * photograph("astronaut", channels=request.param)
    noise = torch.randn(target.shape, generator=torch.Generator().manual_seed(1), dtype=target.dtype)
    return (target + 0.03 * noise).clamp(0.02, 0.98), target


def tolerance(metric: Metric) -> float:
    return 1e-4 if metric.name in ("lpips_alex", "flip") else 1e-9  # both compute in float32


def test_names_are_unique_and_tables_find_a_title_a_unit_and_a_direction() -> None:
    assert len(set(NAMES)) == len(NAMES)
    assert all(metric.available() is None for metric in catalogue() if not metric.name.startswith("lpips"))
    for metric in catalogue():
        assert metric.direction in ("higher", "lower")
        assert metric.name.startswith(metric.title.split()[0].casefold().replace("-", "_"))
        assert (metric.unit, metric.digits) == (("dB", 2) if metric.name == "psnr" else ("", 3))


def test_equal_images_get_the_best_value_and_others_a_worse_in_any_order_batch_and_precision(metric, pair) -> None:
    image, target = pair
    value, turned = float(metric.function(image, target)), float(metric.function(target, image))
    assert (metric.best - value if metric.direction == "higher" else value - metric.best) > 1e-4
    assert (abs(value - turned) <= tolerance(metric)) == (metric.name != "mdsi")
    assert float(metric.function(target, target)) == pytest.approx(metric.best, abs=1e-9)
    batch = metric.function(torch.stack([image, target]), torch.stack([target, target]))
    assert batch.shape == (2,)
    assert batch.tolist() == pytest.approx([value, metric.best], abs=tolerance(metric))
    single = metric.function(image.float(), target.float())
    assert single.dtype == torch.float32
    assert float(single) == pytest.approx(value, rel=2e-4)


@pytest.mark.parametrize("level", [0.0, 1.0])
def test_flat_images_give_finite_values(metric: Metric, pair: tuple[Tensor, Tensor], level: float) -> None:
    _, target = pair
    flat = torch.full_like(target, level)
    values = [metric.function(flat, target), metric.function(target, flat), metric.function(flat, flat)]
    assert all(math.isfinite(float(value)) for value in values)
    assert float(values[2]) == pytest.approx(metric.best, abs=1e-9)


def test_wrong_values_shapes_and_types_are_refused(metric: Metric, pair: tuple[Tensor, Tensor]) -> None:
    image, target = pair
    for wrong in (1.01, -0.01, math.nan, math.inf):
        spoiled = target.clone()
        spoiled[0, 5, 7] = wrong
        with pytest.raises(ValueError, match="image values must be in"):
            metric.function(spoiled, target)
        with pytest.raises(ValueError, match="target values must be in"):
            metric.function(image, spoiled)
    with pytest.raises(ValueError, match="differ in shape"):
        metric.function(image[:, :-1], target)
    with pytest.raises(ValueError, match="C = 1 or 3"):
        metric.function(image[0], target[0])
    with pytest.raises(ValueError, match="C = 1 or 3"):
        metric.function(image[:1].expand(2, -1, -1), target[:1].expand(2, -1, -1))
    with pytest.raises(ValueError, match="float"):
        metric.function(image.to(torch.uint8), target.to(torch.uint8))
    with pytest.raises(ValueError, match="float"):
        metric.function(image.float(), target)


def test_the_smallest_and_an_odd_size_work_and_smaller_is_refused(metric: Metric, pair: tuple[Tensor, Tensor]) -> None:
    image, target = pair
    side = metric.smallest
    assert math.isfinite(float(metric.function(image[:, :side, :side], target[:, :side, :side])))
    assert math.isfinite(float(metric.function(image[:, :171, :190], target[:, :171, :190])))
    with pytest.raises(ValueError, match="at least"):
        metric.function(image[:, : side - 1, :side], target[:, : side - 1, :side])


def test_gradient_equals_the_finite_difference(metric: Metric, pair: tuple[Tensor, Tensor]) -> None:
    if metric.name == "flip":
        pytest.skip("its own code, in NumPy, has no gradient")
    image, target = pair
    if metric.name == "lpips_alex":
        image, target = image[:, :64, :64], target[:, :64, :64]
    step = 1e-3 if metric.name == "lpips_alex" else 1e-6  # the former computes in float32
    variable = image.clone().requires_grad_()
    metric.function(variable, target).backward()
    direction = variable.grad / variable.grad.norm()
    ahead = float(metric.function((image + step * direction), target))
    behind = float(metric.function((image - step * direction), target))
    assert (ahead - behind) / (2 * step) == pytest.approx(float(variable.grad.norm()), rel=2e-2)


def test_gradient_is_finite_for_equal_and_for_black_images(metric: Metric, pair: tuple[Tensor, Tensor]) -> None:
    if metric.name == "flip":
        pytest.skip("its own code, in NumPy, has no gradient")
    _, target = pair
    black = torch.zeros_like(target)
    for start, other in ((target, target), (black, target), (black, black)):
        variable = start.clone().requires_grad_()
        metric.function(variable, other).backward()
        assert bool(variable.grad.isfinite().all())


def test_a_result_is_kept_by_what_the_image_shows_and_the_oldest_goes_first() -> None:
    asked: list[float] = []

    def doubled(image: Tensor) -> Tensor:
        asked.append(float(image.detach().max()))
        return 2 * image

    known = base.remembered(doubled, most=2)
    images = [torch.full((1, 1, 4, 4), value, dtype=torch.float64) for value in (0.1, 0.2, 0.3)]
    for image in (*images[:2], images[0].clone(), images[2], images[0], images[1]):
        assert torch.equal(known(image), 2 * image)
    assert asked == [0.1, 0.2, 0.3, 0.2]
    images[1][0, 0, 0, 0] = 1.0  # the same tensor, another picture
    assert torch.equal(known(images[1]), 2 * images[1])
    assert known(images[0].float()).dtype == torch.float32
    assert known(images[0].reshape(1, 1, 2, 8)).shape == (1, 1, 2, 8)


def test_of_a_large_image_and_with_a_gradient_nothing_is_kept() -> None:
    asked: list[int] = []

    def counted(image: Tensor) -> int:
        asked.append(image.numel())
        return image.numel()

    known = base.remembered(counted)
    for side in (512, 513):
        assert known(torch.zeros(1, 1, side, side)) == known(torch.zeros(1, 1, side, side)) == side**2
    assert asked == [512**2, 513**2, 513**2]
    known = base.remembered(torch.square)
    known(torch.ones(1, 1, 4, 4))
    image = torch.ones(1, 1, 4, 4, requires_grad=True)
    known(image).sum().backward()
    assert torch.equal(image.grad, torch.full((1, 1, 4, 4), 2.0))
    assert not known(torch.ones(1, 1, 4, 4)).requires_grad
    with torch.inference_mode():
        known(torch.full((1, 1, 4, 4), 3.0))
    weight = torch.ones(1, requires_grad=True)
    (weight * known(torch.full((1, 1, 4, 4), 3.0))).sum().backward()
    assert weight.grad == 16 * 9


def test_threads_that_ask_for_different_images_get_their_own_results() -> None:
    known = base.remembered(lambda image: float(image.max()), most=2)
    images = [torch.full((1, 1, 4, 4), float(value)) for value in range(12)]
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        with ThreadPoolExecutor(4) as pool:
            assert list(pool.map(known, images * 50)) == list(range(12)) * 50
    finally:
        sys.setswitchinterval(before)


def test_a_gaussian_filter_is_the_sum_of_shifted_images_and_so_is_its_gradient() -> None:
    draw, taps = torch.Generator().manual_seed(1), base.gaussian_taps(1.5, 3)
    image = torch.rand(2, 3, 11, 13, dtype=torch.float64, generator=draw).requires_grad_()
    weights = torch.rand(2, 3, 5, 7, dtype=torch.float64, generator=draw)
    filtered, expected = base.gaussian_valid(image, 1.5, 3), correlate(correlate(image, taps, -1), taps, -2)
    assert torch.allclose(filtered, expected, rtol=1e-12)
    gradients = [torch.autograd.grad((weights * each).sum(), image)[0] for each in (filtered, expected)]
    assert torch.allclose(*gradients, rtol=1e-12)


@pytest.mark.parametrize(("height", "width"), [(4, 6), (4, 5), (5, 4), (5, 7)])
def test_halving_averages_four_pixels_and_pads_an_odd_side_with_zeros(height: int, width: int) -> None:
    image = torch.rand(2, 3, height, width, generator=torch.Generator().manual_seed(0))
    padded = torch.zeros(2, 3, height + height % 2, width + width % 2)
    padded[..., :height, :width] = image
    four = (padded[..., i::2, j::2] for i in (0, 1) for j in (0, 1))
    assert torch.allclose(base.halved(image), sum(four, torch.zeros(())) / 4)


def test_block_means_leave_out_what_fills_no_block() -> None:
    image = torch.rand(1, 2, 7, 6, generator=torch.Generator().manual_seed(0))
    expected = image[..., :6, :6].reshape(1, 2, 2, 3, 2, 3).mean((3, 5))
    assert torch.allclose(base.block_means(image, 3), expected)
    assert torch.equal(base.block_means(image, 1), image)


def test_a_gradient_has_the_weights_of_its_operator() -> None:
    edge = torch.zeros(1, 1, 5, 6)
    edge[..., 3:] = 1
    ramp = torch.arange(5.0)[:, None].expand(1, 1, 5, 6)
    for kernel in ("prewitt", "scharr"):
        assert base.gradient_magnitude(edge, kernel)[0, 0, 2].tolist() == pytest.approx([0, 0, 1, 1, 0, 1], abs=1e-6)
        assert torch.allclose(base.gradient_magnitude(ramp, kernel)[..., 1:-1, 1:-1], torch.tensor(2.0))


def test_a_blur_keeps_even_light_and_spreads_a_point_by_its_width() -> None:
    assert torch.allclose(base.gaussian_blur(torch.full((1, 1, 20, 30), 0.7), 2.0), torch.tensor(0.7))
    point = torch.zeros(1, 1, 41, 41, dtype=torch.float64)
    point[..., 20, 20] = 1
    soft = base.gaussian_blur(point, 1.5)[0, 0]
    distance = torch.arange(41) - 20
    assert float(soft.sum()) == pytest.approx(1)
    assert float((soft.sum(0) * distance**2).sum()) == pytest.approx(1.5**2, rel=0.01)
    assert float(soft[20, 26]) > 0
    assert float(soft[20, 27]) == 0  # cut off at 4 sigma


@pytest.fixture
def targets(photograph: Photograph) -> list[Tensor]:
    return [srgb_decode(photograph(name, 64)).float() for name in ("astronaut", "coffee", "chelsea")]


def test_rows_have_their_names_and_shape_and_no_other_constant_scores_higher(targets: list[Tensor]) -> None:
    captures = floor_captures(targets[0], targets[1:], "astronaut")
    names = ("constant", "black", "speckle", "wrong_target", "mirrored", "shift_1px")
    assert set(captures) == {f"floor_{name}" for name in names}
    for capture in (made() for made in captures.values()):
        assert capture.shape == targets[0].shape
        assert capture.dtype == targets[0].dtype
        assert capture.data_ptr() not in {target.data_ptr() for target in targets}
    target = targets[0]
    level = floor_captures(target, targets[1:])["floor_constant"]()
    best = float((level - target).square().mean())
    assert all(float((level + d - target).square().mean()) > best for d in (-0.02, 0.02))
    assert score(level, target, metrics=("psnr",))["scale_0"] == pytest.approx(1.0, rel=1e-5)


def test_speckle_is_fully_developed_and_depends_on_its_names_alone(targets: list[Tensor]) -> None:
    first = floor_captures(targets[0], [], "astronaut")["floor_speckle"]()
    assert float(first.mean()) == pytest.approx(1.0, abs=0.03)
    assert float(first.std() / first.mean()) == pytest.approx(1.0, abs=0.03)
    assert torch.equal(first, floor_captures(targets[1], [], "astronaut")["floor_speckle"]())
    assert not torch.equal(first, floor_captures(targets[0], [], "coffee")["floor_speckle"]())


def test_the_wrong_target_is_the_next_of_the_same_shape_and_absent_without_one(targets: list[Tensor]) -> None:
    assert torch.equal(floor_captures(targets[0], targets[1:])["floor_wrong_target"](), targets[1])
    assert "floor_wrong_target" not in floor_captures(targets[0], [])
    with pytest.raises(ValueError, match="one shape"):
        floor_captures(targets[0], [targets[1][:, 1:]])
    point = torch.zeros(1, 16, 16)
    point[0, 4, 3] = 1
    captures = floor_captures(point, [])
    assert captures["floor_mirrored"]().nonzero().tolist() == [[0, 4, 12]]
    assert captures["floor_shift_1px"]().nonzero().tolist() == [[0, 4, 4]]
