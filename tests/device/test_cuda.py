"""A GPU gives what the CPU gives, within stated tolerances; needs a GPU."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import torch
from torch import Tensor

from holobench_eval.core import plugins
from holobench_eval.core.device import CPU, repeatable
from holobench_eval.display import CalibratedBench, load_profile
from holobench_eval.methods.hil.approximator import NetworkApproximator
from holobench_eval.methods.hil.networks import Network
from holobench_eval.methods.learned.retrieval import PhaseRetrieval, retrieve
from holobench_eval.methods.learned.samples import Sample
from holobench_eval.optics import AngularSpectrum
from holobench_eval.study import cost
from holobench_eval.study.opening import open_bench

pytestmark = pytest.mark.skipif(not torch.cuda.is_available(), reason="no CUDA device")

CUDA = torch.device("cuda")
DEVICES = (CPU, CUDA)
PANEL = (256, 256)


def relative(found: Tensor, expected: Tensor) -> float:
    return float((found.cpu() - expected.cpu()).norm() / expected.cpu().norm())


def smooth(shape: tuple[int, ...], seed: int = 1) -> Tensor:
    draw = torch.Generator().manual_seed(seed)
    coarse = torch.rand(1, shape[0], 12, 12, generator=draw)
    return torch.nn.functional.interpolate(coarse, shape[1:], mode="bilinear")[0]


@pytest.fixture(scope="module")
def benches() -> dict[torch.device, CalibratedBench]:
    """The paper-like display without the noise of its camera, on both devices."""
    profile = load_profile("leto-aged")
    quiet = replace(profile, sensor=replace(profile.sensor, noise=False))
    with repeatable(1, CUDA):
        return {device: open_bench(quiet, PANEL, seed=0, device=device) for device in DEVICES}


def psnr(place: CalibratedBench, phase: Tensor, target: Tensor) -> float:
    """PSNR [dB] of the nominal picture at the brightness of its target."""
    fields = [place.spec.propagator(c).forward(torch.polar(torch.ones_like(p), p)) for c, p in enumerate(phase.cpu())]
    image = torch.stack([place.spec.region.crop(field).abs().square() for field in fields])
    image = image * (image * target).sum((1, 2), True) / image.square().sum((1, 2), True)
    return float(-10 * (image - target).square().mean().log10())


@pytest.mark.parametrize("direction", ["forward", "adjoint"])
def test_propagation_within_1e_5(direction: str) -> None:
    draw = torch.Generator().manual_seed(1)
    field = torch.randn(200, 160, dtype=torch.complex64, generator=draw)
    found = {}
    for device in DEVICES:
        model = AngularSpectrum((200, 160), 6.4e-6, 517e-9, 0.01, device=device)
        found[device] = getattr(model, direction)(field.to(device))
    assert relative(found[CUDA], found[CPU]) < 1e-5


def test_twenty_iterations_of_wirtinger_within_a_twentieth_of_a_decibel(benches: dict[Any, CalibratedBench]) -> None:
    method = plugins.build("methods", "wirtinger", {"iterations": 20}, Path())
    target, found = smooth((3, *benches[CPU].spec.region.shape)), []
    for device in DEVICES:
        with repeatable(1, device):
            handle = benches[device].for_method(method, "w", target.to(device), "t", 0)
            found.append(psnr(benches[CPU], method.solve(target[None].to(device), handle)[0], target))
    assert found[1] == pytest.approx(found[0], abs=0.05)


def test_a_capture_without_noise_within_one_in_a_thousand(benches: dict[Any, CalibratedBench]) -> None:
    phase, target = 6 * smooth((3, *PANEL), seed=2), smooth((3, *benches[CPU].spec.region.shape))
    frames = [benches[device].session(("t",), target).capture(phase).linear() for device in DEVICES]
    assert all(frame.device == CPU for frame in frames)
    # a level of the panel that lies between two is rounded one way or the other
    assert relative(frames[1], frames[0]) < 1e-3


def test_the_gradient_through_a_bench(benches: dict[Any, CalibratedBench]) -> None:
    slopes = []
    for device in DEVICES:
        with repeatable(1, device):
            phase = (6 * smooth((3, *PANEL), seed=2)).to(device).requires_grad_()
            grids = tuple(grid.to(device) for grid in benches[CPU].simulation.grids)
            image = replace(benches[device].simulation, grids=grids).image(phase)
            slopes.append(torch.autograd.grad(image.square().sum(), phase)[0])
    assert relative(slopes[1], slopes[0]) < 1e-2


def test_steps_of_hil_and_a_retrieval_through_it() -> None:
    spec = load_profile("leto-aged").spec(PANEL)
    target, phase = smooth((3, *spec.region.shape)), smooth((3, *PANEL), seed=2)
    losses, phases = [], []
    for device in DEVICES:
        with repeatable(1, device):
            network = Network(levels=4, width=8, dropout=True)
            approximator = NetworkApproximator(spec, network, None, with_critic=True, seed=0).to(device)
            place = (phase, 0.5 * target, target, torch.ones(3))
            sample = Sample(*(one.to(device) for one in place))
            approximator.expose([sample])
            losses.append([approximator.step(sample, 0.0)["total"] for _ in range(3)])
            display = approximator.image(sample.light)
            settings = PhaseRetrieval(iterations=3)
            phases.append(retrieve(display, sample.target, sample.phase, settings, approximator.verdict))
    assert losses[1] == pytest.approx(losses[0], rel=1e-2)
    assert float((phases[1].cpu() - phases[0]).square().mean().sqrt()) < 1e-2  # rad


def test_a_gpu_repeats_itself() -> None:
    spec = load_profile("leto-aged").spec(PANEL)
    target, phase = smooth((3, *spec.region.shape)).to(CUDA), smooth((3, *PANEL), seed=2).to(CUDA)

    def losses(name: str, params: dict[str, Any]) -> list[float]:
        with repeatable(1, CUDA):
            approximator = plugins.build("methods", name, params, Path()).approximator(spec).to(CUDA)
            sample = Sample(phase, 0.5 * target, target, torch.ones(3, device=CUDA))
            return [approximator.step(sample, step / 4)["l1"] for step in range(4)]

    for name in ("parametric_model", "hybrid_model", "cnn_prop_cnn", "learned_kernel"):
        assert losses(name, {}) == losses(name, {})


def test_memory_is_that_of_the_gpu() -> None:
    watch = cost.start(CUDA)
    held = torch.ones(48 * 2**18, device=CUDA)
    taken = watch.stop()
    assert held.any()
    assert taken.memory_mib == pytest.approx(48, abs=2)
