"""The optical path through the kernel against the one through torch's transforms."""

import pytest
import torch

from holobench_eval.display.simulated import fused_path
from holobench_eval.display.simulated.fused_path import FusedPath, quickest
from holobench_eval.display.simulated.path import OpticalPath
from holobench_eval.display.simulated.stages.propagation import sample_weights
from holobench_eval.optics import blocks

CPU = torch.device("cpu")
PLAIN, BLAZED = (0.0, 0.0), (0.1, -0.27)


def random(*shape, seed=0):
    return torch.randn(shape, dtype=torch.complex128, generator=torch.Generator().manual_seed(seed))


def path(samples, finer, dusty=None, blaze=PLAIN, shape=(37, 50), padded=(60, 81), legs=None):
    """In double precision; dusty: rows of the plane that have dust, None for no plane."""
    rows, columns = (weights.to(torch.complex128) for weights in sample_weights(padded, samples, blaze, True))
    first, last = legs or (random(*padded, seed=1), random(*padded, seed=2))
    plane = torch.ones(shape, dtype=torch.complex128)
    plane[dusty or []] = random(*shape, seed=3)[dusty or []]
    dust = None if dusty is None else plane - 1
    return OpticalPath(shape, rows, columns, first, dust, None if dusty is None else last, finer)


def single(one):
    """A path in single precision."""
    return one.changed(lambda factor: factor.to(torch.complex64))


def relative(found, expected):
    return float((found - expected).norm() / expected.norm())


def same(one):
    """Image, gradient and intensity of the kernel are those of torch in double precision."""
    fused, samples = quickest(single(one), CPU), len(one.rows)
    assert isinstance(fused, FusedPath)
    light = random(samples, samples, *one.shape, seed=4)
    image = random(*(one.finer * side for side in one.shape), seed=5)
    seen = one.forward(light.requires_grad_())
    (back,) = torch.autograd.grad(seen, light, image)
    light = light.detach().to(torch.complex64).requires_grad_()
    shown = fused.forward(light)
    assert relative(shown.detach(), seen.detach()) < 1e-6
    assert relative(*torch.autograd.grad(shown, light, image.to(torch.complex64)), back) < 1e-6
    lit = fused.intensity(lambda rows: light.detach()[:, :, rows].contiguous())
    assert relative(lit, seen.detach().abs().square()) < 2e-6


@pytest.mark.parametrize(
    ("samples", "finer", "blaze"), [(1, 1, PLAIN), (1, 2, BLAZED), (2, 1, BLAZED), (3, 2, BLAZED), (3, 2, PLAIN)]
)
@pytest.mark.parametrize("dusty", [None, [], [3], [0, 20, 36], list(range(37))])
def test_the_kernel_and_torch_show_the_same_light(samples, finer, dusty, blaze):
    same(path(samples, finer, dusty, blaze))


@pytest.mark.parametrize(("shape", "padded"), [((16, 16), (32, 32)), ((33, 17), (40, 45)), ((7, 100), (10, 135))])
@pytest.mark.parametrize("dusty", [None, [6]])
def test_sizes_of_panel_and_transform_do_not_matter(shape, padded, dusty):
    same(path(3, 2, dusty, BLAZED, shape, padded))
    same(path(1, 1, dusty, PLAIN, shape, padded))


@pytest.mark.parametrize("dusty", [None, [5, 6]])
@pytest.mark.parametrize(
    "clear", [(slice(20, 60), slice(0)), (slice(0), slice(25, 70)), (slice(20, 50), slice(30, 75))]
)
def test_columns_that_one_transfer_function_stops_are_left_out(dusty, clear):
    legs = random(60, 81, seed=1), random(60, 81, seed=2)
    for leg, columns in zip(legs, clear, strict=True):
        leg[:, columns] = 0
    one = path(3, 2, dusty, legs=legs)
    same(one)
    if dusty is None and clear[0] != slice(0):
        few, all_of_them = (len(quickest(single(each), CPU)._panel.grid.starts) for each in (one, path(3, 2)))
        assert few < all_of_them


def test_light_does_not_depend_on_the_rows_that_are_lit_at_once_or_on_the_number_of_threads(monkeypatch):
    one, found = quickest(single(path(3, 2, [4, 18])), CPU), []
    light = random(3, 3, 37, 50).to(torch.complex64)
    for size in (1, 2**30):
        monkeypatch.setattr(blocks, "BLOCK_BYTES", size)
        found.append(one.intensity(lambda rows: light[:, :, rows].contiguous()))
    assert torch.equal(*found)
    once = one.forward(light)
    for threads in (2, 5):
        torch.set_num_threads(threads)
        again = one.forward(light)
        torch.set_num_threads(1)
        assert torch.equal(once, again)


@pytest.mark.parametrize(
    "unfit",
    [path(3, 2), single(path(1, 1, padded=(60, 77))), single(path(1, 1, shape=(20, 20), padded=(30, 30)))],
    ids=["double precision", "a size with primes 7 and 11", "few columns"],
)
def test_torch_does_what_the_kernel_is_not_made_for(unfit):
    assert isinstance(quickest(unfit, CPU), OpticalPath)


def test_without_the_kernel_light_goes_by_torch(monkeypatch):
    one = single(path(1, 1))
    assert isinstance(quickest(one, CPU), FusedPath)
    assert isinstance(quickest(one, torch.device("meta")), OpticalPath)
    monkeypatch.setattr(fused_path, "kernel", lambda: None)
    assert isinstance(quickest(one, CPU), OpticalPath)
