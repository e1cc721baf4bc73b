"""Sums of shifted images are correlations, and their hand-written adjoint is the adjoint."""

import pytest
import torch
from torch.nn import functional

from holobench_eval.imaging.shifts import correlate, correlate_each

FILTERS = [[0.2, -0.5, 1.0], [0.0, 0.7, 0.1]]


@pytest.mark.parametrize("dim", [-2, -1])
def test_each_filter_gives_what_a_convolution_gives(dim):
    image = torch.rand(2, 9, 7, dtype=torch.float64)
    kernels = torch.tensor(FILTERS, dtype=torch.float64)
    kernels = kernels[:, None, :, None] if dim == -2 else kernels[:, None, None, :]
    assert torch.allclose(correlate_each(image, FILTERS, dim), functional.conv2d(image[:, None], kernels))
    assert torch.equal(correlate(image, FILTERS[1], dim), correlate_each(image, FILTERS, dim)[:, 1])


@pytest.mark.parametrize("dim", [-2, -1])
def test_the_gradient_of_a_correlation_is_its_derivative(dim):
    image = torch.rand(2, 5, 6, dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(lambda x: correlate_each(x, FILTERS, dim), image)
