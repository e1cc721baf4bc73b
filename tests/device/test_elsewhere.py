"""Everything that a GPU is to compute stays there: shown on a device without values, "meta", by ``Elsewhere``."""

import importlib
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import torch
from torch import Tensor
from torch.utils._python_dispatch import TorchDispatchMode
from torch.utils._pytree import tree_leaves

from holobench_eval.core import plugins
from holobench_eval.core.device import CPU, moved
from holobench_eval.display import CalibratedBench, load_profile
from holobench_eval.display.learned import LearnedBench
from holobench_eval.display.simulated.pipeline import SimulatedBench
from holobench_eval.display.training import TrainingBench, TrainingImage
from holobench_eval.methods.calibrated import patterns
from holobench_eval.methods.fiducials import fiducial_phases
from holobench_eval.methods.hil.approximator import NetworkApproximator
from holobench_eval.methods.hil.networks import Network
from holobench_eval.methods.learned import fallback
from holobench_eval.methods.learned.samples import Sample
from holobench_eval.methods.losses import LOSSES
from holobench_eval.methods.twin import method as twin
from holobench_eval.methods.wirtinger import Objective, Wirtinger
from tests.support.benches.replaying import fake_device
from tests.support.small_training import SHORT_OPEN_LOOP

PANEL = (208, 208)  # the least whose region MS-SSIM is defined on
SMALL = {"levels": 3, "width": 4}
SHORT = {"rounds": 2, "images": 1, "refine_images": 1, "steps": 1, "refine_steps": 1}
ONCE = SHORT | {"rounds": 1}
STEPS = {"retrieval": {"iterations": 1}, "start": {"iterations": 1}}

ELSEWHERE = torch.device("meta")
aten = torch.ops.aten
REFUSED = {
    *(aten.histc.default, aten.kthvalue.default, aten.median.dim, aten.cumsum.default, aten.bincount.default),
    *(aten.reflection_pad1d_backward.default, aten.reflection_pad2d_backward.default),
    *(aten.grid_sampler_2d_backward.default, aten.upsample_bilinear2d_backward.default),
    *(aten.upsample_bicubic2d_backward.default, aten._adaptive_avg_pool2d_backward.default),
    *(aten.adaptive_max_pool2d_backward.default, aten.nll_loss_forward.default, aten.put_.default),
}
"""What torch has no deterministic form of on a GPU (``torch.use_deterministic_algorithms``), and so refuses there."""


class Elsewhere(TorchDispatchMode):
    """Every operation of torch is watched, backward ones too: as on a GPU, none may mix tensors of two devices, none
    may be in ``REFUSED``.

    Numbers of the CPU (tensors without dimensions) may be mixed in. What is read from the device, which has no values,
    is zero, but for the states of random numbers (bytes) that were brought there; a single number is 1, a truth True
    and a count 0.
    """

    def __torch_dispatch__(self, func: Any, types: Any, args: Any = (), kwargs: Any = None) -> Any:
        kwargs = kwargs or {}
        tensors = [one for one in tree_leaves((args, kwargs)) if isinstance(one, Tensor)]
        if func is aten._to_copy.default:
            to = torch.device(kwargs.get("device") or args[0].device)
            if to.type == "cpu" and args[0].device == ELSEWHERE:
                nothing = torch.zeros(args[0].shape, dtype=kwargs.get("dtype") or args[0].dtype)
                return getattr(args[0], "brought", nothing)
            there = func(*args, **kwargs)
            if args[0].dtype == torch.uint8:
                there.brought = args[0]
            return there
        if func is aten.copy_.default:
            return args[0].zero_() if args[1].device == ELSEWHERE else func(*args, **kwargs)
        devices = {one.device.type for one in tensors if one.ndim}
        if func in REFUSED and ELSEWHERE.type in devices:
            raise AssertionError(f"{func} has no deterministic form on a GPU")
        if len(devices) > 1:
            raise AssertionError(f"{func} mixes devices: {[(one.device.type, tuple(one.shape)) for one in tensors]}")
        if func is aten._local_scalar_dense.default and args[0].device == ELSEWHERE:
            number = args[0].dtype
            return True if number == torch.bool else 1.0 if number.is_floating_point else 0
        if func in (aten._fused_adam_.default, aten._fused_adam_.tensor_lr) and ELSEWHERE.type in devices:
            assert all(one.device == ELSEWHERE for one in tensors)  # its counts of steps and its rate as well
            return None
        return func(*args, **kwargs)


@pytest.fixture(autouse=True)
def fused_adam(monkeypatch: pytest.MonkeyPatch) -> None:
    """Adam's fused step knows the devices that it has a form for."""
    adam = importlib.import_module("torch.optim.adam")
    monkeypatch.setattr(adam, "_device_dtype_check_for_fused", lambda *_: None)


class Registered:
    """A registration that nothing had to be photographed for; the camera's pixels are the panel's."""

    residual = (0.0, 0.0, 0.0)

    def __init__(self, shape: tuple[int, int]) -> None:
        self.shape = shape
        rows, columns = np.mgrid[: shape[0], : shape[1]].astype(np.float32)
        self.warps = (SimpleNamespace(coordinates=lambda: (columns, rows)),) * 3

    def rectify(self, linear: torch.Tensor) -> torch.Tensor:
        assert linear.device == CPU
        return linear[:, : self.shape[0], : self.shape[1]]


def bench(name: str, **stages: Any) -> CalibratedBench:
    profile = replace(load_profile(name).scaled(PANEL), **stages)
    registered: Any = SimpleNamespace(registration=Registered(profile.spec().region.shape))
    return CalibratedBench(SimulatedBench(profile, ELSEWHERE), 0, fiducial_phases, registered)


@pytest.fixture(scope="module")
def ideal() -> CalibratedBench:
    return bench("ideal")


def picture(place: CalibratedBench, device: torch.device = ELSEWHERE) -> torch.Tensor:
    return torch.rand(3, *place.spec.region.shape, device=device)


class Halved(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, x: torch.Tensor) -> torch.Tensor:
        return x / 2

    @staticmethod
    def backward(ctx: Any, grad: torch.Tensor) -> torch.Tensor:
        return grad * torch.full((3,), 0.5)


def test_the_watch_sees_two_devices_forward_and_backward() -> None:
    with Elsewhere():
        x = torch.zeros(3, device=ELSEWHERE, requires_grad=True)
        with pytest.raises(AssertionError, match="mixes devices"):
            x * torch.zeros(3)
        with pytest.raises(AssertionError, match="mixes devices"):
            torch.autograd.grad(Halved.apply(x).sum(), x)
        assert (x * torch.zeros(())).device == ELSEWHERE


@pytest.mark.parametrize("loss", LOSSES)
def test_loss_and_gradient_of_wirtinger(ideal: CalibratedBench, loss: Any) -> None:
    with Elsewhere():
        model = ideal.spec.propagator(0, device=ELSEWHERE)
        objective = Objective(model, ideal.spec.region, picture(ideal)[:1], LOSSES[loss])
        value, gradient = objective.evaluate(torch.zeros(1, *PANEL, device=ELSEWHERE))
    assert value.device == gradient.device == ELSEWHERE


@pytest.mark.parametrize("name", ["leto-dusty", "plm-4bit", "pluto-offaxis"])
def test_a_simulated_bench_and_its_gradient(name: str) -> None:
    place = bench(name)
    with Elsewhere():
        phase = torch.zeros(3, *PANEL, device=ELSEWHERE, requires_grad=True)
        mean, variance = place.simulation.expected(phase, picture(place))
        (gradient,) = torch.autograd.grad(mean.sum() + variance.sum(), phase)
        capture = place.session(("t",), picture(place)).capture(phase.detach())
        shot = place.photograph(torch.zeros(3, *PANEL), picture(place, CPU), "t", 0)
    assert mean.device == variance.device == gradient.device == ELSEWHERE
    assert capture.frame.device == shot.image.device == CPU


METHODS: dict[str, dict[str, Any]] = {
    "double_phase": {"quantile": 0.9},
    "double_phase_aa": {},
    "double_phase_bl": {},
    "gerchberg_saxton": {"iterations": 1},
    "hio": {"iterations": 1},
    "wirtinger": {"iterations": 1},
    "sgd": {"iterations": 1, "initial_phase": "quadratic"},
    "multi_plane": {"iterations": 1, "initial_phase": "dpe"},
    "oracle": {"iterations": 1, "start_iterations": 1},
    "online_camera": {"captures": 16, "start": {"converged": {"iterations": 1}, "early": {"iterations": 1}}},
    "online_camera_network": {
        "captures": 20,
        "steps": 1,
        "network": SMALL,
        "retrieval": {"iterations": 1},
        "start": {"converged": {"iterations": 1}, "early": {"iterations": 1}},
    },
}


@pytest.mark.parametrize("name", METHODS)
def test_a_method_solves_where_its_target_is(ideal: CalibratedBench, name: str) -> None:
    method = plugins.build("methods", name, METHODS[name], Path())
    with Elsewhere():
        target = picture(ideal)
        phase = method.solve(target[None], ideal.for_method(method, name, target, "t", 0))
    assert phase.device == ELSEWHERE


@pytest.mark.parametrize("name", ["wirtinger", "sgd", "multi_plane"])
def test_iterations_to_be_recorded_run_where_their_target_is(ideal: CalibratedBench, name: str) -> None:
    method = plugins.build("methods", name, {"iterations": 5, "offset": "none"}, Path())
    with fake_device(ELSEWHERE.type, records=False) as cuda, Elsewhere():
        target = picture(ideal)
        phase = method.solve(target[None], ideal.for_method(method, name, target, "t", 0))
    assert phase.device == ELSEWHERE
    assert cuda.watches == 3


TRAINED: dict[str, dict[str, Any]] = {
    "hil": STEPS | {"network": SMALL | {"dropout": True}, "training": SHORT, "fallback": True},
    "hil_tuned": STEPS | {"network": SMALL, "training": ONCE, "offsets": 2},
    "hil_nh3d": STEPS | {"network": {"name": "unet", "levels": 2, "width": 4}, "training": ONCE},
    "hil_terms": STEPS | {"network": SMALL | {"name": "unet"}, "training": ONCE, "search": {"iterations": 1}},
    "hil_plus": STEPS | {"network": SMALL, "training": ONCE, "search": {"iterations": 1}},
    "parametric_model": STEPS | {"training": SHORT, "patterns": 1, "search": {"iterations": 1}},
    "learned_kernel": STEPS | {"training": SHORT, "search": {"iterations": 1}},
    "cnn_prop_cnn": STEPS | {"training": SHORT, "patterns": 1, "search": {"iterations": 1}},
    "hybrid_model": STEPS | {"training": SHORT, "patterns": 1, "search": {"iterations": 1}},
    "twin": STEPS | {"training": ONCE, "patterns": 1, "holograms": 1, "search": {"iterations": 1}},
}


class Memory:
    """Keeps what a training gives it, and looks at where it lies."""

    def __init__(self) -> None:
        self.kept: dict[str, Any] = {}

    def load(self, name: str) -> Any:
        return self.kept.get(name)

    def save(self, name: str, value: Any) -> None:
        assert moved(value, CPU) is value
        self.kept[name] = value

    def log(self, row: Any) -> None:
        pass


@pytest.mark.parametrize("name", TRAINED)
def test_a_method_learns_resumes_and_solves_where_its_images_are(ideal: CalibratedBench, name, monkeypatch) -> None:
    monkeypatch.setattr(fallback, "WIRTINGER", Wirtinger(iterations=1))
    monkeypatch.setattr(patterns, "Wirtinger", partial(Wirtinger, iterations=1))
    monkeypatch.setattr(twin, "OPEN_LOOP", SHORT_OPEN_LOOP)
    method, memory = plugins.build("methods", name, TRAINED[name], Path()), Memory()
    with Elsewhere():
        images = [TrainingImage(f"image {number}", picture(ideal)) for number in range(2)]
        for _ in range(2):
            state = method.prepare(TrainingBench(ideal, name, images[:1], images[1:], memory, None, 0))
            memory.kept["approximator"]["value"]["step"] = 0  # of its last round, where the second one goes on
        learned = moved(moved(state, CPU), ELSEWHERE)
        handle = ideal.for_method(method, name, images[0].target, "t", 0, learned=learned)
        phase = method.solve(images[0].target[None], handle)
        display = LearnedBench(ideal.spec, method, learned, 0, ELSEWHERE)
        shot = display.photograph(torch.zeros(3, *PANEL), picture(ideal, CPU), "t", 0)
    assert phase.device == ELSEWHERE
    assert shot.image.device == CPU


def test_pix2pixhd_and_the_default_loss_take_a_step() -> None:
    spec = load_profile("ideal").spec(PANEL)
    network = Network("pix2pixhd", levels=2, width=4)
    approximator = NetworkApproximator(spec, network, None, with_critic=True, seed=0).to(ELSEWHERE)
    with Elsewhere():
        target = torch.rand(3, *spec.region.shape, device=ELSEWHERE)
        sample = Sample(torch.zeros(3, *PANEL, device=ELSEWHERE), target, target, torch.ones(3, device=ELSEWHERE))
        approximator.expose([sample])
        assert set(approximator.step(sample, 0.0)) >= {"adversarial", "feature_matching", "judge"}
