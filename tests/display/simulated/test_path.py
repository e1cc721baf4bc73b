"""The linear part of a bench by torch: dust is where it is, and a field is sampled as finely as it says."""

from dataclasses import replace

import pytest
import torch

from holobench_eval.display.simulated.path import OpticalPath, finer_line
from holobench_eval.display.simulated.stages.propagation import sample_weights

SHAPE, PADDED = (10, 13), (18, 21)


def random(*shape):
    return torch.randn(shape, dtype=torch.complex128)


def path(samples, finer):
    rows, columns = (weights.to(torch.complex128) for weights in sample_weights(PADDED, samples, (0.1, 0.2), True))
    return OpticalPath(SHAPE, rows, columns, random(*PADDED), random(*SHAPE), random(*PADDED), finer)


@pytest.mark.parametrize("dusty", [[], [4], [0, 3, 9], list(range(10))])
def test_light_passes_the_dust_as_if_every_row_were_transformed(dusty):
    torch.manual_seed(3)
    one, field = path(1, 1), random(1, 1, *SHAPE)
    plane = torch.ones(SHAPE, dtype=torch.complex128)
    plane[dusty, 2:5] = random(len(dusty), 3)
    beyond = torch.ones(PADDED, dtype=torch.complex128)
    beyond[: SHAPE[0], : SHAPE[1]] = plane
    light = torch.fft.fft2(field[0, 0], s=PADDED) * one.rows[0][:, None] * one.columns[0][None, :]
    behind = torch.fft.fft2(torch.fft.ifft2(light * one.transfer) * beyond) * one.last
    seen = replace(one, dust=plane - 1).forward(field)
    assert torch.allclose(seen, torch.fft.ifft2(behind)[: SHAPE[0], : SHAPE[1]], atol=1e-12)


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
    one, field = path(3, 2), random(3, 3, *SHAPE)
    before = field.clone()
    assert torch.equal(one.forward(field), one.forward(field))
    assert torch.equal(field, before)
