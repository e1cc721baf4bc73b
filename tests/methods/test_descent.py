"""Adam's steps are torch's, compiled or not."""

import pytest
import torch

from holobench_eval.core import compiled
from holobench_eval.methods.descent import Adam, adam, by_autograd


def gradients(steps: int, *shape: int) -> list[torch.Tensor]:
    draw = torch.Generator().manual_seed(1)
    some = torch.rand(shape, generator=draw) > 0.1  # a pixel without a gradient stays
    return [some * torch.randn(shape, generator=draw) * (0.1 + step % 3) for step in range(steps)]


@pytest.mark.parametrize("with_numba", [True, False])
def test_steps_are_those_of_torch(with_numba, monkeypatch):
    monkeypatch.setattr(compiled, "AVAILABLE", with_numba and compiled.AVAILABLE)
    phase, expected = torch.zeros(2, 2, 30, 41)
    ours, theirs = Adam(phase, 0.1), torch.optim.Adam([expected], eps=1e-8 / (30 * 41))
    for step, gradient in enumerate(gradients(30, 2, 30, 41)):
        rate = 0.1 / (1 + step)
        expected.grad, theirs.param_groups[0]["lr"] = gradient.clone(), rate
        ours.set_rate(rate)
        ours.step(gradient)
        theirs.step()
    assert torch.allclose(phase, expected, atol=1e-6)
    assert phase.abs().max() > 0.1


def test_the_size_of_the_panel_changes_no_pixel_of_the_descent():
    small = torch.rand(1, 8, 8, generator=torch.Generator().manual_seed(2))

    def descend(start):
        return adam(start, by_autograd(lambda phase: (phase - 0.5).pow(4).mean((1, 2))), iterations=40, step=0.01)

    large = descend(small.repeat(1, 5, 5))
    assert torch.allclose(descend(small).repeat(1, 5, 5), large, atol=1e-6)


@pytest.mark.parametrize("with_numba", [True, False])
def test_the_layout_of_arrays_in_memory_changes_nothing(with_numba, monkeypatch):
    monkeypatch.setattr(compiled, "AVAILABLE", with_numba and compiled.AVAILABLE)
    start, goal = torch.rand(2, 1, 12, 20, generator=torch.Generator().manual_seed(2))

    def turned(phase):  # its gradient lies column by column
        return ((phase.mT.contiguous() - goal.mT).square()).mean((1, 2))

    def plain(phase):
        return (phase - goal).square().mean((1, 2))

    found = [adam(start, by_autograd(loss), iterations=20, step=0.05) for loss in (plain, turned)]
    by_columns = adam(start.mT.contiguous().mT, by_autograd(plain), iterations=20, step=0.05)
    assert torch.allclose(found[0], found[1], atol=1e-6)
    assert torch.allclose(found[0], by_columns, atol=1e-6)
