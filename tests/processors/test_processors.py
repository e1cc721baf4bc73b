"""The noise of another processor reaches what it should; ``python -m tests.processors`` runs tests with it."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import torch
from torch import Tensor
from torch.nn import functional

from holobench_eval.imaging.warp import remap
from holobench_eval.optics import AngularSpectrum, FourierLens
from holobench_eval.optics.phasor import squared_modulus
from tests.golden.outputs import cases, recorded, share
from tests.processors.__main__ import told
from tests.processors.noise import another

SHAPE = (48, 40)
KERNEL = torch.randn(1, 1, 3, 3, generator=torch.Generator().manual_seed(1))


def near(dtype: torch.dtype) -> AngularSpectrum:
    return AngularSpectrum(SHAPE, 6.4e-6, 517e-9, 4e-3, dtype=dtype)


def light(field: Tensor) -> Tensor:
    return squared_modulus(near(torch.complex64).forward(torch.complex(field, field)))


def slope(function: Callable[[Tensor], Tensor], at: Tensor) -> Tensor:
    at = at.clone().requires_grad_()
    return torch.autograd.grad(function(at).sum(), at)[0]


STEPS: dict[str, Callable[[Tensor], Tensor]] = {
    "by the kernel": lambda x: near(torch.complex64).forward(x + 0j),
    "back by the kernel": lambda x: near(torch.complex64).adjoint(x + 0j),
    "by torch": lambda x: near(torch.complex128).forward(x.double() + 0j),
    "behind a lens": lambda x: FourierLens(SHAPE, 8e-6, 532e-9, 0.25).forward(x + 0j),
    "convolution": lambda x: functional.conv2d(x[None, None], KERNEL),
    "convolution by transforms": lambda x: torch.fft.irfft2(torch.fft.rfft2(x) * 0.3),
    "gradient of a propagation": lambda x: slope(lambda y: light(y).square(), x),
    "gradient of a convolution": lambda x: slope(lambda y: STEPS["convolution"](y).square(), x),
    "sine": torch.sin,
}


@pytest.mark.parametrize("step", STEPS)
def test_another_processor_gives_other_last_bits_and_the_same_ones_again(step: str) -> None:
    field = torch.randn(SHAPE, generator=torch.Generator().manual_seed(2))
    here = STEPS[step](field)
    results = []
    for number in (1, 1, 2):
        with another(number):
            results.append(STEPS[step](field))
    with another(1), torch.inference_mode("gradient" not in step):
        assert torch.equal(STEPS[step](field), results[0])
    first, again, second = results
    assert torch.equal(first, again)
    assert not torch.equal(first, second)
    size = here.abs().square().mean().sqrt() * torch.finfo(here.dtype).eps
    for result in (first, second):
        assert 0.05 * size < (result - here).abs().square().mean().sqrt() < 10 * size
    assert torch.equal(STEPS[step](field), here)


def test_what_is_whole_is_exact_on_every_processor() -> None:
    counts = torch.arange(12.0).view(3, 4)
    with another(1):
        assert torch.equal(counts.sum(0), torch.tensor([12.0, 15.0, 18.0, 21.0]))
        assert torch.equal(torch.zeros(3).cos(), torch.ones(3))


def test_a_pixel_that_is_copied_is_exact_and_an_interpolated_one_is_not() -> None:
    frame = np.random.default_rng(1).random((6, 8)).astype(np.float32)
    x, y = np.meshgrid(np.arange(5, dtype=np.float32), np.arange(4, dtype=np.float32))
    between = remap(frame, x + 0.25, y)
    with another(1):
        assert np.array_equal(remap(frame, x + 1, y), frame[:4, 1:6])
        assert not np.array_equal(remap(frame, x + 0.25, y), between)


def test_a_golden_moves_by_less_than_a_third_of_its_tolerance() -> None:
    name = "method wirtinger"
    case, entry = cases()[name], recorded()[name]["numbers"]
    here = case.numbers()
    with another(1):
        there = case.numbers()
    assert there != here
    assert all(share(case, there[part], entry[part]) < 1 / 3 for part in entry)


def test_what_fails_there_and_what_noise_leaves_too_little_room_is_told(tmp_path: Path) -> None:
    rooms = ((0.3, 0.5), (0.25, 0.3), (0.35, 0.5))  # of two comparisons, on this processor and on two others
    for number, values in enumerate(rooms):
        lines = [["a test", f"line {line}", value] for line, value in enumerate(values)]
        lines += [["a test", "failed", 0]] * (number == 2)
        (tmp_path / f"{number}").write_text("\n".join(map(json.dumps, lines)))
    assert told([tmp_path / f"{number}" for number in range(3)]) == [
        "a test: failed on 2",
        "a test: line 1: room 0.5, of which noise takes 0.2",
    ]
