"""A GPU gives what the CPU gives, within stated tolerances; needs a GPU."""

import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import torch
from torch import Tensor

from holobench_eval.core import graphs, plugins
from holobench_eval.core.device import CPU, repeatable
from holobench_eval.display import CalibratedBench, load_profile
from holobench_eval.display.resampling import Resampling
from holobench_eval.methods.hil.approximator import NetworkApproximator
from holobench_eval.methods.hil.networks import Network
from holobench_eval.methods.learned.retrieval import PhaseRetrieval, retrieve
from holobench_eval.methods.learned.samples import Sample
from holobench_eval.methods.losses import LOSSES
from holobench_eval.methods.wirtinger import Wirtinger
from holobench_eval.optics import AngularSpectrum
from holobench_eval.study import cost
from holobench_eval.study.opening import open_bench
from tests.support.benches.replaying import Traffic

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
    """`leto-aged` without the noise of its camera, on both devices."""
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


RETRIEVALS: dict[str, tuple[str, dict[str, Any]]] = {
    **{loss: ("wirtinger", {"loss": loss}) for loss in LOSSES},
    "a falling step": ("wirtinger", {"schedule": "cosine"}),
    "sgd": ("sgd", {}),
    "multi_plane": ("multi_plane", {}),
}


@pytest.mark.parametrize("retrieval", RETRIEVALS)
def test_twenty_iterations_within_a_twentieth_of_a_decibel(benches: dict[Any, CalibratedBench], retrieval: str) -> None:
    name, params = RETRIEVALS[retrieval]
    method = plugins.build("methods", name, {"iterations": 20, **params}, Path())
    target, found = smooth((3, *benches[CPU].spec.region.shape)), []
    for device in DEVICES:
        with repeatable(1, device):
            handle = benches[device].for_method(method, "w", target.to(device), "t", 0)
            found.append(psnr(benches[CPU], method.solve(target[None].to(device), handle)[0], target))
    assert found[1] == pytest.approx(found[0], abs=0.05)


class Counted(graphs.CudaGraph):
    """Counts replays."""

    replays = 0

    def replay(self) -> None:
        Counted.replays += 1
        super().replay()


class Loop(graphs.CudaGraph):
    """Runs every step as it is."""

    def record(self, step: Callable[[], Any]) -> Any:
        raise RuntimeError("nothing is recorded")


@pytest.mark.parametrize("retrieval", RETRIEVALS)
def test_iterations_are_replayed_with_the_bits_of_a_loop(benches, retrieval, monkeypatch) -> None:
    name, params = RETRIEVALS[retrieval]
    method = plugins.build("methods", name, {"iterations": 20, **params}, Path())
    target, found = smooth((1, *benches[CUDA].spec.region.shape)).to(CUDA), []
    monkeypatch.setattr(Counted, "replays", 0)
    for recorder in (Counted, Loop):
        monkeypatch.setattr(graphs, "RECORDERS", {"cuda": recorder})
        with repeatable(1, CUDA):
            found.append(method.solve(target[None], benches[CUDA].for_method(method, "w", target, "t", 0)))
    assert Counted.replays == 20 - graphs.WARM_UP - 1
    assert torch.equal(found[0], found[1])


def test_a_step_that_waits_is_never_recorded_and_random_numbers_go_on(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(graphs.CudaGraph, "record", lambda self, step: pytest.fail("it was recorded"))
    value, stream = torch.zeros((), device=CUDA), torch.cuda.current_stream()

    def step() -> None:
        if value.item() < 100:
            value.add_(1)

    again = graphs.repeated(step, CUDA)
    for _ in range(6):
        again()
    assert value.item() == 6
    assert torch.cuda.current_stream() == stream
    assert torch.cuda.get_sync_debug_mode() == 0
    assert torch.rand(3, device=CUDA).isfinite().all()


FAILING = """
import torch
from holobench_eval.core.graphs import repeated

device = torch.device("cuda")
value, stream = torch.zeros((), device=device), torch.cuda.current_stream()


def step():
    torch.cuda.synchronize()  # the watch does not see it, and no graph can hold it
    value.add_(1)


again = repeated(step, device)
for _ in range(6):
    again()
assert value.item() == 6
assert torch.cuda.current_stream() == stream
assert torch.zeros(2**20, device=device).sum().item() == 0
"""


def test_a_recording_that_fails_is_followed_by_a_loop() -> None:
    """In a process of its own: what it leaves behind in torch is not known."""
    ended = subprocess.run([sys.executable, "-c", FAILING], capture_output=True, text=True, check=False)
    assert ended.returncode == 0, ended.stderr


def bandwidth() -> float:
    """Bytes a second that a copy reads and writes."""
    source = torch.ones(2**28, device=CUDA)  # 1 GiB, many times what caches hold
    target, ends = torch.empty_like(source), [torch.cuda.Event(enable_timing=True) for _ in range(2)]
    target.copy_(source)
    ends[0].record()
    for _ in range(20):
        target.copy_(source)
    ends[1].record()
    torch.cuda.synchronize()
    return 20 * 2 * source.numel() * 4 / (ends[0].elapsed_time(ends[1]) / 1000)


def test_300_iterations_at_1080p_under_2_s(benchmark: Any) -> None:
    """One colour, transfer function and plans of transforms known; ``-s`` shows time and share of the bandwidth."""
    place: Any = SimpleNamespace(spec=load_profile("ideal").spec((1080, 1920)))
    target, seconds, traffic = smooth((1, *place.spec.region.shape))[None].to(CUDA), [], []

    def solve(iterations: int) -> None:
        begin = time.perf_counter()
        Wirtinger(iterations=iterations, offset="none").solve(target, place)
        torch.cuda.synchronize()
        seconds.append(time.perf_counter() - begin)

    with repeatable(1, CUDA):
        solve(1)  # what is made once
        for iterations in (1, 2):  # neither is recorded
            with Traffic() as counted:
                solve(iterations)
            traffic.append(counted.bytes)
        solve(300)
        seconds.clear()
        benchmark.pedantic(solve, (300,), rounds=3)
    share = 300 * (traffic[1] - traffic[0]) / min(seconds) / bandwidth()
    benchmark.extra_info["share of the memory bandwidth"] = share
    print(f"\n300 iterations: {min(seconds):.3f} s, {share:.0%} of the memory bandwidth (goal: 2 s and 60 %)")
    assert min(seconds) < 2


def test_a_capture_without_noise_within_one_in_a_thousand(benches: dict[Any, CalibratedBench]) -> None:
    phase, target = 6 * smooth((3, *PANEL), seed=2), smooth((3, *benches[CPU].spec.region.shape))
    frames = [benches[device].session(("t",), target).capture(phase).linear() for device in DEVICES]
    assert all(frame.device == CPU for frame in frames)
    # a level of the panel that lies between two is rounded one way or the other
    assert relative(frames[1], frames[0]) < 1e-3


def test_the_gradient_through_a_bench(benches: dict[Any, CalibratedBench]) -> None:
    slopes, target = [], smooth((3, *benches[CPU].spec.region.shape))
    for device in DEVICES:
        with repeatable(1, device):
            phase = (6 * smooth((3, *PANEL), seed=2)).to(device).requires_grad_()
            places = ((one.x.to(device), one.y.to(device)) for one in benches[CPU].simulation.resamplings)
            simulation = replace(benches[device].simulation, resamplings=tuple(Resampling(*at) for at in places))
            mean, variance = simulation.expected(phase, target.to(device))
            slopes.append(torch.autograd.grad((mean.square() + variance).sum(), phase)[0])
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
    watch = cost.Stopwatch(CUDA)
    held = torch.ones(48 * 2**18, device=CUDA)
    taken = watch.stop()
    assert held.any()
    assert taken.memory_mib == pytest.approx(48, abs=2)
