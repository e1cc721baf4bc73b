"""The compiled passes of a step give what torch gives, for any region, batch and number of threads."""

import pytest
import torch

from holobench_eval.core import compiled
from holobench_eval.display.api import Region
from holobench_eval.methods.losses import LOSSES, intensity_l2
from holobench_eval.methods.phase_propagation import PhasePropagation
from holobench_eval.optics import AngularSpectrum

MODEL = AngularSpectrum((90, 131), pitch=6.4e-6, wavelength=517e-9, distance=3e-3)
REGIONS = [Region(0, 0, 90, 131), Region(7, 20, 61, 83), Region(0, 100, 3, 31), Region(80, 1, 10, 1)]


def pair(region: Region, batch: int = 2, model: AngularSpectrum = MODEL) -> tuple[torch.Tensor, torch.Tensor]:
    draw = torch.Generator().manual_seed(1)
    return 40 * torch.rand(batch, *model.shape, generator=draw) - 20, torch.rand(batch, *region.shape, generator=draw)


def step(phase, target, region, loss=intensity_l2, model=MODEL):
    light = PhasePropagation(model, region, phase)
    return light.weigh(loss, target), light.phase_gradient()


@pytest.fixture
def hide(monkeypatch):
    """Hides what is compiled, as on a machine without Numba."""
    return lambda: monkeypatch.setattr(compiled, "AVAILABLE", False)


@pytest.mark.parametrize("region", REGIONS, ids=str)
@pytest.mark.parametrize("loss", list(LOSSES)[:4])
def test_a_step_without_numba_is_the_same_but_for_rounding(loss, region, hide):
    phase, target = pair(region)
    before = phase.clone()
    fast = step(phase, target, region, LOSSES[loss])
    assert torch.equal(phase, before)
    hide()
    slow = step(phase, target, region, LOSSES[loss])
    assert torch.allclose(fast[0], slow[0], rtol=1e-6)
    assert (fast[1] - slow[1]).norm() < 2e-6 * slow[1].norm()


def test_single_precision_gives_the_gradient_of_double_precision():
    region = REGIONS[1]
    phase, target = pair(region)
    double = AngularSpectrum(MODEL.shape, MODEL.pitch, MODEL.wavelength, MODEL.distance, dtype=torch.complex128)
    loss, gradient = step(phase, target, region)
    exact, expected = step(phase.double(), target.double(), region, model=double)
    assert torch.allclose(loss.double(), exact, rtol=1e-5)
    assert (gradient - expected).norm() < 1e-5 * expected.norm()


def test_a_step_is_the_same_for_any_number_of_threads():
    model = AngularSpectrum((600, 800), pitch=6.4e-6, wavelength=517e-9, distance=3e-3)
    region, before = Region(50, 60, 500, 700), torch.get_num_threads()
    phase, target = pair(region, batch=1, model=model)
    try:
        steps = []
        for threads in (1, 3):
            torch.set_num_threads(threads)
            steps.append(step(phase, target, region, model=model))
    finally:
        torch.set_num_threads(before)
    for one, other in zip(*steps, strict=True):
        assert torch.equal(one, other)


def test_arrays_that_are_views_give_the_same():
    phase, target = pair(REGIONS[1])
    contiguous = step(phase, target, REGIONS[1])
    views = step(phase.mT.contiguous().mT, target.mT.contiguous().mT, REGIONS[1])
    assert torch.allclose(contiguous[0], views[0])
    assert (contiguous[1] - views[1]).norm() < 2e-6 * contiguous[1].norm()


def test_a_black_target_gives_no_gradient():
    phase, target = pair(REGIONS[1])
    loss, gradient = step(phase, torch.zeros_like(target), REGIONS[1])
    assert loss.eq(0).all()
    assert gradient.eq(0).all()


def test_a_target_of_another_size_than_the_region_is_refused():
    phase, target = pair(REGIONS[1])
    with pytest.raises(RuntimeError, match="size"):
        step(phase, target[:, 1:], REGIONS[1])


def test_a_phase_that_could_have_a_gradient_has_none_here():
    phase, target = pair(REGIONS[1])
    with torch.no_grad():
        loss, gradient = step(phase.clone().requires_grad_(), target, REGIONS[1])
    for one, other in zip((loss, gradient), step(phase, target, REGIONS[1]), strict=True):
        assert torch.equal(one, other)
