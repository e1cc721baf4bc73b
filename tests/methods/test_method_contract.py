"""What every shipped method promises, whatever its algorithm: over all entry points."""

import sys
from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from typing import Any

import pytest
import torch
from torch import Tensor

from holobench_eval.core import plugins
from holobench_eval.core.errors import UserError
from holobench_eval.display.metered import MeteredDisplay
from holobench_eval.display.traits import traits_of
from holobench_eval.methods.calibrated import patterns
from holobench_eval.methods.learned import fallback, retrieval
from holobench_eval.methods.learned.retrieval import Image
from holobench_eval.methods.predictors import veil
from holobench_eval.methods.predictors.nested import NestedPrediction
from holobench_eval.methods.simulated import through
from holobench_eval.methods.twin import method as twin
from holobench_eval.methods.wirtinger import Wirtinger
from tests.support import small_training as small
from tests.support.toy_camera import ToyDisplay

NAMES = plugins.names("methods")
CLASSES = {name: plugins.find("methods", name) for name in NAMES}
TRAINED = [name for name in NAMES if getattr(CLASSES[name], "trains", False)]
PREDICTING = [name for name in TRAINED if hasattr(CLASSES[name], "predict")]
NESTED = [name for name in PREDICTING if issubclass(CLASSES[name], NestedPrediction)]
WITH_CAMERA = [name for name in NAMES if traits_of(CLASSES[name]).camera]
SPEC = replace(small.small_spec(48, 40, colours=3), shape=(48, 56))
SPECS = {"through": small.modelled()}  # of a method that not every display will do for
all_methods = pytest.mark.parametrize("name", NAMES)
predicting = pytest.mark.parametrize("name", PREDICTING)


@pytest.fixture(autouse=True)
def _short_holograms(monkeypatch: pytest.MonkeyPatch) -> None:
    """Trainings that are compared bit by bit need no converged holograms of dark patterns and of the fallback."""
    for module in (patterns, veil, through):
        monkeypatch.setattr(module, "Wirtinger", lambda iterations=5: Wirtinger(iterations=iterations))
    monkeypatch.setattr(fallback, "WIRTINGER", Wirtinger(iterations=5))
    monkeypatch.setattr(twin, "OPEN_LOOP", small.SHORT_OPEN_LOOP)


def short(name: str) -> Any:
    """A shipped method with short settings, in its start too."""
    method = small.quick(name)
    return replace(method, start=replace(method.start, iterations=5)) if name == "hil_tuned" else method


def trained(method: Any, seed: int = 3) -> Mapping[str, Any]:
    """What a short training gives, as it comes back from its file."""
    return small.through_a_file(dict(method.prepare(small.training_bench(SPEC, small.Memory(), images=2, seed=seed))))


@cache
def learned(name: str) -> Mapping[str, Any]:
    return trained(short(name))


def test_every_method_that_learns_a_display_has_the_switch_of_the_fallback_and_leaves_it_off() -> None:
    assert {name for name in PREDICTING if CLASSES[name]().fallback is False} == set(PREDICTING)


def opened(name: str, target: Tensor) -> tuple[Any, MeteredDisplay]:
    """A method with short settings and its handle for targets ``(B, C, h, w)``."""
    method = short(name)
    if (reason := getattr(method, "available", lambda: None)()) is not None:
        pytest.skip(reason)
    if name in TRAINED:
        return method, small.solving_bench(method, target[0], SPEC, learned(name))
    display = ToyDisplay(aberration=0.3, unmodulated=0.1, noise=0.02, spec=SPECS.get(name, SPEC))
    return method, display.handle(method, target[0])


def solved(name: str, target: Tensor) -> Tensor:
    method, handle = opened(name, target)
    phase: Tensor = method.solve(target, handle)
    return phase


@all_methods
def test_a_phase_is_finite_the_same_again_and_in_any_batch_and_takes_a_cameras_captures_alone(name: str) -> None:
    spec = SPECS.get(name, SPEC)
    target, phases = small.pictures(spec, 2), []
    before = target.clone()
    for seed in (1, 2):
        torch.manual_seed(seed)
        method, handle = opened(name, target)
        phases.append(method.solve(target, handle))
        assert 0 < handle.captures <= 2 * method.captures if name in WITH_CAMERA else handle.captures == 0
    assert torch.equal(target, before)
    assert torch.equal(*phases)
    assert phases[0].shape == (2, 3, *spec.shape)
    assert phases[0].dtype == torch.float32
    assert phases[0].isfinite().all()
    assert not phases[0].requires_grad
    if name not in WITH_CAMERA:  # whose captures are taken one after the other, under noise of their own
        assert furthest(method, target, handle, phases[0]) < 1e-3


def test_an_image_does_not_depend_on_its_batch_in_a_line_search(bench, scene) -> None:
    method = plugins.build("methods", "wirtinger", {"iterations": 6, "optimiser": "lbfgs"})
    assert furthest(method, scene(batch=2), bench, method.solve(scene(batch=2), bench)) < 1e-3


def furthest(method: Any, target: Tensor, handle: Any, together: Tensor) -> float:
    """Largest difference [rad] of a phase of a batch from that of the image alone."""
    apart = torch.cat([method.solve(image[None], handle) for image in target])
    difference = torch.remainder(together - apart + torch.pi, 2 * torch.pi) - torch.pi
    return float(difference.abs().max())


@all_methods
def test_a_black_channel_gives_a_finite_phase(name: str) -> None:
    target = small.pictures(SPECS.get(name, SPEC))
    target[:, 1] = 0
    assert solved(name, target).isfinite().all()


def test_every_method_has_a_name_for_people_that_no_other_has() -> None:
    titles = [vars(cls).get("title") for cls in CLASSES.values()]
    assert None not in titles
    assert len(set(titles)) == len(titles)


@all_methods
def test_a_method_declares_what_it_uses_and_says_what_it_is(name: str) -> None:
    cls = CLASSES[name]
    traits = traits_of(cls)
    assert traits.privileged == (name == "oracle")
    assert traits.camera == name.startswith("online_camera")
    assert traits.trains == hasattr(cls, "prepare")
    assert traits.version >= 1
    assert cls() == plugins.build("methods", name, {})
    assert cls.__doc__
    assert cls.__doc__.partition("\n")[0].strip()


@predicting
def test_what_was_learned_predicts_what_retrieval_saw(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    retrieve, seen = retrieval.retrieve, []

    def watched(display: Image, target: Tensor, start: Tensor, *settings: Any) -> Tensor:
        phase = retrieve(display, target, start, *settings)
        seen.append(display(phase))
        return phase

    for module in [module for module in sys.modules.values() if vars(module).get("retrieve") is retrieve]:
        monkeypatch.setattr(module, "retrieve", watched)
    target = small.pictures(SPEC, 2)
    method, handle = opened(name, target)
    captures = method.predict(method.solve(target, handle), handle)
    assert captures.shape == target.shape
    assert captures.isfinite().all()
    assert not captures.requires_grad
    shown = torch.stack(seen)
    assert torch.allclose(captures, shown.square() if name == "hil_nh3d" else shown, atol=1e-5)  # it saw amplitudes


@predicting
def test_training_is_decided_by_the_seeds_alone(name: str) -> None:
    torch.manual_seed(8)
    once = learned(name)
    assert name not in NESTED or small.same(trained(short(name)), once)  # of the others, see below
    assert not small.same(trained(short(name), seed=4), once)
    drawn = name not in ("parametric_model", "partially_coherent_model", "learned_kernel", "image_terms", "twin")
    assert small.same(trained(replace(short(name), seed=1)), once) != drawn


FAMILIES = ("parametric_model", "hil", "hil_plus", "twin")  # of each kind of training, one to its last photograph


# The error budget's three are trained as the parametric model is; the end of a training is that of all.
@pytest.mark.parametrize("name", [name for name in PREDICTING if name not in NESTED])
def test_a_method_killed_in_training_learns_the_same_bits(name: str) -> None:
    method, memory = replace(short(name), fallback=True), small.Memory(as_files=True)
    bench = small.training_bench(SPEC, memory, images=2)
    whole, moments = method.prepare(bench), memory.fate.passed
    kinds = ("after a photograph", "after keeping approximator")
    photographs, kept = ([at for at, moment in enumerate(moments) if moment == kind] for kind in kinds)
    for at in (photographs[1], kept[0], *photographs[-1:] * (name in FAMILIES)):
        memory = small.Memory(as_files=True)
        torch.manual_seed(at)
        with pytest.raises(small.Killed):
            method.prepare(small.training_bench(SPEC, memory, small.Fate(at), images=2))
        torch.manual_seed(at + 1)
        again = small.training_bench(SPEC, memory, images=2)
        assert small.same(method.prepare(again), whole), (at, moments[at])
        assert again.captures == bench.captures, (at, moments[at])


@pytest.mark.parametrize(
    ("name", "pupil", "params"),
    [("gerchberg_saxton", None, {"iterations": 100}), ("wirtinger", None, {"iterations": 100}), ("wirtinger", 0.8, {})],
)
def test_iterating_beats_double_phase_behind_its_iris_too(name, pupil, params, make_bench, scene, linear_psnr):
    bench, target = make_bench(pupil=pupil), scene(channels=3)
    direct = plugins.build("methods", "double_phase", {}).solve(target, bench)
    iterated = plugins.build("methods", name, params).solve(target, bench)
    assert linear_psnr(iterated, target, bench) > linear_psnr(direct, target, bench) + 3


@pytest.mark.parametrize(
    ("name", "params", "words"),
    [
        ("wirtinger", {"iterations": 0}, "'iterations'"),
        ("wirtinger", {"loss": "l3"}, "'loss'"),
        ("wirtinger", {"losses": "huber"}, "did you mean 'loss'"),
        ("wirtinger", {"step": -1}, "'step'"),
        ("wirtinger", {"initial_phase": "noise"}, "'initial_phase'"),
        ("gerchberg_saxton", {"offset": "middle"}, "'offset'"),
        ("hio", {"beta": 3}, "'beta'"),
        ("sgd", {"iterations": "many"}, "'iterations'"),
        ("double_phase", {"quantile": 0}, "'quantile'"),
        ("double_phase_aa", {"sigma": 0}, "'sigma'"),
        ("double_phase_bl", {"band": 2}, "'band'"),
        ("oracle", {"iterations": 1.5}, "'iterations'"),
        ("through", {"profile": ""}, "'profile'"),
        ("hil", {"network": {"name": "unett"}}, "'network"),
        ("hil", {"rates": {"generator": 0}}, "'rates.generator'"),
        ("hil", {"training": {"rounds": 0}}, "'training.rounds'"),
        ("hil", {"retrieval": {"l2": -1}}, "'retrieval.l2'"),
        ("hil_tuned", {"offsets": 0}, "'offsets'"),
        ("hil_plus", {"retrieval": {"adversarial": 0.5}}, "adversarial"),
        ("hil_nh3d", {"training": {"step": 3}}, "did you mean 'steps'"),
        ("parametric_model", {"patterns": -1}, "'patterns'"),
        ("cnn_prop_cnn", {"width": 0}, "'width'"),
    ],
)
def test_a_wrong_parameter_is_one_line_that_names_it(name, params, words):
    with pytest.raises(UserError) as caught:
        plugins.build("methods", name, params)
    message = str(caught.value)
    assert words in message
    assert name in message
    assert "\n" not in message
