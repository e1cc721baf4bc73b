import pytest
import torch

from holobench_eval.methods.learned.samples import Sample
from holobench_eval.methods.online.network import OnlineCameraNetwork, ShortRetrieval, corrected
from tests.methods.online.test_camera import FAULTY, TINY, nominal, solved
from tests.support.toy_camera import ToyDisplay, picture

SMALL = {"of": OnlineCameraNetwork, "network": TINY}


def test_rounds_of_captures_improve_the_hologram():
    display, target = ToyDisplay(**FAULTY, noise=0.01), picture()
    started, _ = solved(display, target, **SMALL, captures=20, retrieval=ShortRetrieval(iterations=0))
    phase, handle = solved(display, target, **SMALL)
    assert handle.captures <= 100
    assert (display.error(phase, target) < 0.8 * display.error(started, target)).all()
    assert (display.error(phase, target) < 0.5 * display.error(nominal(display, target), target)).all()


@pytest.mark.parametrize(("faults", "noise"), [({}, 0.0), (FAULTY, 0.3)])
def test_neither_an_ideal_display_nor_noise_makes_it_worse_than_wirtinger_holography(faults, noise):
    display, target = ToyDisplay(**faults, noise=noise), picture()
    phase, _ = solved(display, target, **SMALL, captures=42)
    assert (display.scored(phase, target) < 1.02 * display.scored(nominal(display, target), target)).all()


@pytest.mark.parametrize("budget", [1, 8, 40])
def test_it_stays_within_the_budget_of_the_display(budget):
    phase, handle = solved(ToyDisplay(**FAULTY), picture(), budget, **SMALL, steps=1)
    assert handle.captures <= budget
    assert phase.isfinite().all()


def test_what_the_prediction_misses_of_the_captures_is_added_to_it():
    gray, phases = torch.full((2, 16, 16), 0.5), [torch.full((2, 1, 1), value) for value in (0.1, 0.5)]
    captures = [gray + 2 * phase for phase in phases]
    samples = [Sample(*pair, gray, torch.ones(2)) for pair in zip(phases, captures, strict=True)]
    display = corrected(lambda phase: gray + phase, samples)
    assert torch.allclose(display(torch.zeros(2, 1, 1)), gray + 0.3, atol=1e-6)
