"""Cost of a simulated capture of one colour channel at 1080 x 1920, against one ideal propagation of the same panel."""

from dataclasses import replace

import pytest
import torch

from holobench_eval.display import load_profile
from holobench_eval.display.bench import SimulatedBench


@pytest.fixture(scope="module", params=[1, 3], ids=["1 sub-sample", "3 sub-samples"])
def bench(request, panel):
    return SimulatedBench(replace(load_profile("leto-aged"), sampling=request.param).scaled(panel))


@torch.no_grad()
def test_capture(benchmark, bench):
    session = bench.session("benchmark", exposure=(4000.0,))
    phase = torch.rand(1, *bench.spec.shape) * 6
    benchmark(session.capture, phase)


@torch.no_grad()
def test_ideal_propagation_of_the_same_channel(benchmark, bench):
    field = torch.polar(torch.ones(bench.spec.shape), torch.rand(bench.spec.shape))
    benchmark(bench.spec.propagator(0).forward, field)
