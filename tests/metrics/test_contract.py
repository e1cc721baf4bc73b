"""What every metric promises: best value for equal images, symmetry, checks of its input, finite values, gradients."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import pytest
import torch
from torch import Tensor

from holobench_eval.metrics import Metric, catalogue

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


def test_names_are_unique_and_available_without_weights() -> None:
    assert len(set(NAMES)) == len(NAMES)
    assert all(metric.available() is None for metric in catalogue() if not metric.name.startswith("lpips"))


def test_tables_find_a_title_a_unit_and_a_direction() -> None:
    for metric in catalogue():
        assert metric.direction in ("higher", "lower")
        assert metric.name.startswith(metric.title.split()[0].casefold().replace("-", "_"))
        assert (metric.unit, metric.digits) == (("dB", 2) if metric.name == "psnr" else ("", 3))


def test_equal_images_get_the_best_value_and_others_a_worse_in_either_order_in_a_batch_and_in_single_precision(
    metric: Metric, pair: tuple[Tensor, Tensor]
) -> None:
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


def test_values_outside_the_range_are_refused(metric: Metric, pair: tuple[Tensor, Tensor]) -> None:
    image, target = pair
    for wrong in (1.01, -0.01, math.nan, math.inf):
        spoiled = target.clone()
        spoiled[0, 5, 7] = wrong
        with pytest.raises(ValueError, match="image values must be in"):
            metric.function(spoiled, target)
        with pytest.raises(ValueError, match="target values must be in"):
            metric.function(image, spoiled)


def test_wrong_shapes_and_types_are_refused(metric: Metric, pair: tuple[Tensor, Tensor]) -> None:
    image, target = pair
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
