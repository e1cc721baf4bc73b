"""The fast ways from a phase to a field and to an intensity equal the plain ones, and so do their gradients."""

import torch

from holobench_eval.optics.phasor import mean_phasor, phasor, squared_modulus

AMPLITUDE = torch.rand(5, 6, dtype=torch.float64, generator=torch.Generator().manual_seed(0))


def test_phasor_is_a_polar_field_with_its_gradient():
    phase = (20 * torch.rand(3, 5, 6, dtype=torch.float64) - 10).requires_grad_()
    assert torch.allclose(phasor(AMPLITUDE, phase), torch.polar(AMPLITUDE.expand(3, 5, 6), phase))
    assert torch.autograd.gradcheck(lambda angle: phasor(AMPLITUDE, angle), phase)


def test_squared_modulus_is_that_with_its_gradient():
    field = torch.randn(5, 6, dtype=torch.complex128, requires_grad=True)
    assert torch.allclose(squared_modulus(field), field.abs().square())
    assert torch.autograd.gradcheck(squared_modulus, field)


def test_a_mean_of_phasors_is_that_with_its_gradient():
    phase = (20 * torch.rand(3, 5, 6, dtype=torch.float64) - 10).requires_grad_()
    for dim in (0, 1, -1):
        assert torch.allclose(mean_phasor(phase, dim), torch.polar(torch.ones_like(phase), phase).mean(dim))
        assert torch.autograd.gradcheck(mean_phasor, (phase, dim))
