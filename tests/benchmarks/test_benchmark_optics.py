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

PUPILS = {"no iris": None, "iris 0.8": 0.8}


def spec(panel, pupil):
    height, width = panel
    region = Region(height // 12, width // 12, height * 5 // 6, width * 5 // 6)
    return DisplaySpec("benchmark", panel, 6.4e-6, (517e-9,), 0.1 * height / 1080, 8, pupil, region)


@pytest.mark.parametrize("pupil", PUPILS.values(), ids=PUPILS.keys())
def test_four_bare_ffts(benchmark, panel, pupil):
    shape = spec(panel, pupil).propagator(0).padded_shape
    fields = torch.randn(1, *shape, dtype=torch.complex64)

    def transforms():
        for _ in range(2):
            torch.fft.ifft2(torch.fft.fft2(fields))

    benchmark(transforms)


@pytest.mark.parametrize("pupil", PUPILS.values(), ids=PUPILS.keys())
def test_ideal_propagation(benchmark, panel, pupil):
    model = spec(panel, pupil).propagator(0)
    field = unit_field(torch.rand(1, *panel))
    benchmark(model.forward, field)


@pytest.mark.parametrize("pupil", PUPILS.values(), ids=PUPILS.keys())
def test_wirtinger_iteration(benchmark, panel, pupil):
    optics = spec(panel, pupil)
    target = torch.rand(1, *optics.region.shape)
    objective = Objective(optics.propagator(0), optics.region, target, LOSSES["intensity_l2"])
    phase = torch.rand(1, *panel)
    best = Best(phase)
    optimiser = torch.optim.Adam([phase], lr=0.1)

    def iteration():
        loss, phase.grad = objective.evaluate(phase)
        best.update(loss, phase)
        optimiser.step()

    benchmark(iteration)
