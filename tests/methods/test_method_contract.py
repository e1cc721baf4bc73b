"""What every shipped method promises, whatever its algorithm: over all entry points."""

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
from tests.support.small_training import (
    Memory,
    pictures,
    quick,
    small_spec,
    solving_bench,
    through_a_file,
    training_bench,
)
from tests.support.toy_camera import ToyDisplay

NAMES = plugins.names("methods")
CLASSES = {name: plugins.find("methods", name) for name in NAMES}
TRAINED = [name for name in NAMES if getattr(CLASSES[name], "trains", False)]
PREDICTING = [name for name in TRAINED if hasattr(CLASSES[name], "predict")]
WITH_CAMERA = [name for name in NAMES if CLASSES[name].camera]
SPEC = replace(small_spec(48, 40, colours=3), shape=(48, 56))
all_methods = pytest.mark.parametrize("name", NAMES)


@cache
def learned(name: str) -> Mapping[str, Any]:
    """What a short training gives."""
    return through_a_file(dict(quick(name).prepare(training_bench(SPEC, Memory(), images=2))))


def test_every_method_that_learns_a_display_has_the_switch_of_the_fallback_and_leaves_it_off() -> None:
    assert {name for name in PREDICTING if CLASSES[name]().fallback is False} == set(PREDICTING)


def opened(name: str, target: Tensor) -> tuple[Any, MeteredDisplay]:
    """A method with short settings and its handle for targets ``(B, C, h, w)``."""
    method = quick(name)
    if (reason := getattr(method, "available", lambda: None)()) is not None:
        pytest.skip(reason)
    if name in TRAINED:
        return method, solving_bench(method, target[0], SPEC, learned(name))
    display = ToyDisplay(aberration=0.3, unmodulated=0.1, noise=0.02, spec=SPEC)
    return method, display.handle(method, target[0])


def solved(name: str, target: Tensor) -> Tensor:
    method, handle = opened(name, target)
    phase: Tensor = method.solve(target, handle)
    return phase


@all_methods
def test_a_phase_has_the_shape_of_the_panel_and_is_finite(name: str) -> None:
    phase = solved(name, pictures(SPEC, 2))
    assert phase.shape == (2, 3, *SPEC.shape)
    assert phase.dtype == torch.float32
    assert phase.isfinite().all()
    assert not phase.requires_grad


@all_methods
def test_the_target_is_left_as_it_was(name: str) -> None:
    target = pictures(SPEC)
    before = target.clone()
    solved(name, target)
    assert torch.equal(target, before)


@all_methods
def test_the_same_cell_gives_the_same_phase_whatever_torchs_random_numbers(name: str) -> None:
    phases = []
    for seed in (1, 2):
        torch.manual_seed(seed)
        phases.append(solved(name, pictures(SPEC)))
    assert torch.equal(*phases)


# The captures of a batch are taken one after the other, under noise of their own.
@pytest.mark.parametrize("name", [name for name in NAMES if name not in WITH_CAMERA])
def test_an_image_does_not_depend_on_its_batch(name: str) -> None:
    target = pictures(SPEC, 2)
    together = solved(name, target)
    handle = opened(name, target)[1]  # made for the first image, as the batch's is
    apart = torch.cat([quick(name).solve(image[None], handle) for image in target])
    difference = torch.remainder(together - apart + torch.pi, 2 * torch.pi) - torch.pi
    assert difference.abs().max() < 1e-3


def test_an_image_does_not_depend_on_its_batch_in_a_line_search(bench, scene) -> None:
    method = plugins.build("methods", "wirtinger", {"iterations": 6, "optimiser": "lbfgs"})
    target = scene(batch=2)
    together = method.solve(target, bench)
    apart = torch.cat([method.solve(target[i : i + 1], bench) for i in range(2)])
    difference = torch.remainder(together - apart + torch.pi, 2 * torch.pi) - torch.pi
    assert difference.abs().max() < 1e-3


@all_methods
def test_a_black_channel_gives_a_finite_phase(name: str) -> None:
    target = pictures(SPEC)
    target[:, 1] = 0
    assert solved(name, target).isfinite().all()


@all_methods
def test_captures_are_taken_by_methods_with_a_camera_alone_and_within_their_number(name: str) -> None:
    method, handle = opened(name, pictures(SPEC))
    method.solve(pictures(SPEC), handle)
    assert 0 < handle.captures <= method.captures if name in WITH_CAMERA else handle.captures == 0


@all_methods
def test_a_method_declares_what_it_uses_and_says_what_it_is(name: str) -> None:
    cls = CLASSES[name]
    assert cls.privileged == (name == "oracle")
    assert cls.camera == name.startswith("online_camera")
    assert getattr(cls, "trains", False) == hasattr(cls, "prepare")
    assert getattr(cls, "version", 1) >= 1
    assert cls() == plugins.build("methods", name, {})
    assert cls.__doc__
    assert cls.__doc__.partition("\n")[0].strip()


@pytest.mark.parametrize("name", PREDICTING)
def test_what_a_training_gives_can_be_kept_and_predicts_captures(name: str) -> None:
    target = pictures(SPEC, 2)
    method, handle = opened(name, target)
    captures = method.predict(method.solve(target, handle), handle)
    assert captures.shape == target.shape
    assert captures.isfinite().all()
    assert not captures.requires_grad


@pytest.mark.parametrize("name", ["gerchberg_saxton", "hio"])
def test_another_cell_starts_from_another_random_phase(name, bench, scene):
    target = scene()
    here = plugins.build("methods", name, {"iterations": 6}).solve(target, bench)
    bench.cell = "another cell"
    assert not torch.allclose(here, plugins.build("methods", name, {"iterations": 6}).solve(target, bench), atol=0.1)


@pytest.mark.parametrize("name", ["gerchberg_saxton", "hio", "wirtinger", "sgd"])
def test_iterating_beats_double_phase_where_no_iris_helps_it(name, bench, scene, linear_psnr):
    target = scene(channels=3)
    direct = plugins.build("methods", "double_phase", {}).solve(target, bench)
    iterated = plugins.build("methods", name, {"iterations": 100}).solve(target, bench)
    assert linear_psnr(iterated, target, bench) > linear_psnr(direct, target, bench) + 3


@pytest.mark.parametrize("name", ["wirtinger", "sgd"])
def test_gradient_methods_beat_double_phase_behind_its_iris(name, make_bench, scene, linear_psnr):
    bench, target = make_bench(pupil=0.8), scene(channels=3)
    direct = plugins.build("methods", "double_phase", {}).solve(target, bench)
    iterated = plugins.build("methods", name, {}).solve(target, bench)
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
    ],
)
def test_a_wrong_parameter_is_one_line_that_names_it(name, params, words):
    with pytest.raises(UserError) as caught:
        plugins.build("methods", name, params)
    message = str(caught.value)
    assert words in message
    assert name in message
    assert "\n" not in message
