"""Costs of the hot path at 1080 x 1920 pixels, z = 0.1 m, against bare FFTs of the padded size.

``pytest tests/benchmarks --benchmark-enable --benchmark-only`` measures; compare the medians of one run as ratios.
"""

import pytest
import torch

from holobench_eval.display import DisplaySpec, Region
from holobench_eval.methods.common import unit_field
from holobench_eval.methods.descent import Best
from holobench_eval.methods.losses import LOSSES
from holobench_eval.methods.wirtinger import Objective

SHAPE = (1080, 1920)
PUPILS = {"no iris": None, "iris 0.8": 0.8}


@pytest.fixture(autouse=True)
def two_threads():
    before = torch.get_num_threads()
    torch.set_num_threads(2)
    yield
    torch.set_num_threads(before)


def spec(pupil):
    region = Region(100, 180, 880, 1560)
    return DisplaySpec("benchmark", SHAPE, 6.4e-6, (517e-9,), 0.1, 8, pupil, region)


@pytest.mark.parametrize("pupil", PUPILS.values(), ids=PUPILS.keys())
def test_four_bare_ffts(benchmark, pupil):
    shape = spec(pupil).propagator(0).padded_shape
    fields = torch.randn(1, *shape, dtype=torch.complex64)

    def transforms():
        for _ in range(2):
            torch.fft.ifft2(torch.fft.fft2(fields))

    benchmark(transforms)


@pytest.mark.parametrize("pupil", PUPILS.values(), ids=PUPILS.keys())
def test_ideal_propagation(benchmark, pupil):
    model = spec(pupil).propagator(0)
    field = unit_field(torch.rand(1, *SHAPE))
    benchmark(model.forward, field)


@pytest.mark.parametrize("pupil", PUPILS.values(), ids=PUPILS.keys())
def test_wirtinger_iteration(benchmark, pupil):
    optics = spec(pupil)
    target = torch.rand(1, *optics.region.shape)
    objective = Objective(optics.propagator(0), optics.region, target, LOSSES["intensity_l2"])
    phase = torch.rand(1, *SHAPE)
    best = Best(phase)
    optimiser = torch.optim.Adam([phase], lr=0.1)

    def iteration():
        loss, phase.grad = objective.evaluate(phase)
        best.update(loss, phase)
        optimiser.step()

    benchmark(iteration)
