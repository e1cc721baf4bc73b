"""The linear part of a bench: its adjoint is the adjoint, and it samples a field as finely as it says."""

from dataclasses import replace

import pytest
import torch

from holobench_eval.display.simulated.path import Dust, OpticalPath, finer_line, image
from holobench_eval.display.simulated.stages.propagation import sample_weights

SHAPE, PADDED = (10, 13), (18, 21)


def random(*shape):
    return torch.randn(shape, dtype=torch.complex128)


def path(samples, finer, dust, clean=()):
    plane = random(*SHAPE)
    plane[list(clean)] = 1
    rows, columns = (weights.to(torch.complex128) for weights in sample_weights(PADDED, samples, (0.1, 0.2), True))
    last = random(*PADDED) if dust else None
    return OpticalPath(SHAPE, rows, columns, random(*PADDED), Dust.of(plane) if dust else None, last, finer)


@pytest.mark.parametrize("dust", [False, True])
@pytest.mark.parametrize("clean", [[], [0, 4, 5]])
@pytest.mark.parametrize(("samples", "finer"), [(1, 1), (3, 2)])
def test_the_adjoint_passes_the_dot_product_test(samples, finer, dust, clean):
    torch.manual_seed(0)
    one = path(samples, finer, dust, clean)
    field = random(samples, samples, *SHAPE)
    light = random(finer * SHAPE[0], finer * SHAPE[1])
    assert torch.allclose((light.conj() * one.forward(field)).sum(), (one.adjoint(light).conj() * field).sum())


@pytest.mark.parametrize("dusty", [[], [4], [0, 3, 9], list(range(10))])
def test_light_passes_the_dust_as_if_every_row_were_transformed(dusty):
    torch.manual_seed(3)
    one, field = path(1, 1, dust=True), random(1, 1, *SHAPE)
    plane = torch.ones(SHAPE, dtype=torch.complex128)
    plane[dusty, 2:5] = random(len(dusty), 3)
    beyond = torch.ones(PADDED, dtype=torch.complex128)
    beyond[: SHAPE[0], : SHAPE[1]] = plane
    light = torch.fft.fft2(field[0, 0], s=PADDED) * one.rows[0][:, None] * one.columns[0][None, :]
    behind = torch.fft.fft2(torch.fft.ifft2(light * one.transfer) * beyond) * one.last
    assert torch.allclose(
        replace(one, dust=Dust.of(plane)).forward(field), torch.fft.ifft2(behind)[: SHAPE[0], : SHAPE[1]], atol=1e-12
    )


def test_the_gradient_is_the_numerical_one():
    torch.manual_seed(1)
    one = path(2, 2, dust=True)
    field = random(2, 2, *SHAPE).requires_grad_()
    seen = image(one, field)
    direction, weight = random(2, 2, *SHAPE), torch.rand(seen.shape, dtype=torch.float64)
    (grad,) = torch.autograd.grad((weight * seen.abs().square()).sum(), field)
    with torch.no_grad():
        after, before = (image(one, field + step * direction).abs().square() for step in (1e-6, -1e-6))
    slope = (weight * (after - before)).sum() / 2e-6
    assert float((grad.conj() * direction).sum().real) == pytest.approx(float(slope), rel=1e-6)


def test_a_finer_field_is_the_same_field_sampled_twice_as_finely():
    for shape in ((8, 10), (9, 7)):
        spectrum = torch.fft.fft2(torch.randn(shape, dtype=torch.complex64))
        spectrum[shape[0] // 2, :] = 0
        spectrum[:, shape[1] // 2] = 0
        fine = finer_line(finer_line(spectrum, 2).T, 2).T
        fine = fine[: 2 * shape[0], : 2 * shape[1]]
        assert torch.allclose(fine[::2, ::2], torch.fft.ifft2(spectrum), atol=1e-5)


def test_the_light_of_the_panel_is_left_as_it_is():
    torch.manual_seed(2)
    one, field = path(3, 2, dust=True), random(3, 3, *SHAPE)
    before = field.clone()
    assert torch.equal(image(one, field), image(one, field))
    assert torch.equal(field, before)
