"""The models by themselves: what they are before they learn, and what they can and cannot learn."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest
import torch
from torch import Tensor

from holobench_eval.display.api import DisplaySpec, white_irradiance
from holobench_eval.display.nominal import ideal_image
from holobench_eval.methods.calibrated.approximator import ModelApproximator
from holobench_eval.methods.calibrated.cnn_prop_cnn import CNNPropCNN
from holobench_eval.methods.calibrated.hybrid import HybridModel
from holobench_eval.methods.calibrated.kernel import LearnedKernel
from holobench_eval.methods.calibrated.networks import ColourByColour
from holobench_eval.methods.calibrated.parametric import ParametricModel
from holobench_eval.methods.calibrated.patterns import random_phase
from holobench_eval.methods.learned.samples import Sample
from holobench_eval.optics import AngularSpectrum
from tests.support.small_training import BentDisplay, pictures, small_spec

SPEC = small_spec(48, 36, colours=2)
LIGHT = torch.tensor([2.0, 3.0])


def a_phase(spec: DisplaySpec, seed: int = 0) -> Tensor:
    return random_phase(len(spec.wavelengths), spec.shape, 3.0, torch.Generator().manual_seed(seed))


@pytest.mark.parametrize("method", [LearnedKernel(), CNNPropCNN(width=4)])
@pytest.mark.parametrize("pupil", [None, 0.8])
def test_an_untrained_model_is_the_ideal_display(method: LearnedKernel | CNNPropCNN, pupil: float | None) -> None:
    spec = replace(SPEC, pupil=pupil)
    shown = method.approximator(spec).image(LIGHT)(a_phase(spec))
    assert torch.allclose(shown, ideal_image(a_phase(spec), spec) / LIGHT[:, None, None], atol=1e-4)


def test_an_untrained_hybrid_is_the_untrained_parametric_model() -> None:
    shown = [one.approximator(SPEC).image(LIGHT)(a_phase(SPEC)) for one in (HybridModel(), ParametricModel())]
    assert torch.equal(*shown)


def samples(spec: DisplaySpec, capture: Callable[[Tensor], Tensor], count: int, seed: int = 0) -> list[Sample]:
    """Random patterns and what a display makes of them."""
    found = []
    for number in range(count):
        phase, target = a_phase(spec, seed + number), pictures(spec, 1, number)[0]
        light = white_irradiance(target, spec)
        found.append(Sample(phase, capture(phase) / light[:, None, None], target, light))
    return found


def fit(approximator: ModelApproximator, learned_from: list[Sample], steps: int) -> None:
    for step in range(steps):
        approximator.step(learned_from[step % len(learned_from)], step / steps)


def error(approximator: ModelApproximator, unseen: list[Sample]) -> float:
    """Relative absolute error of what is predicted."""
    with torch.no_grad():
        errors = [
            (approximator.image(one.light)(one.phase) - one.capture).abs().mean() / one.capture.mean() for one in unseen
        ]
    return float(torch.stack(errors).mean())


def defocused(phase: Tensor) -> Tensor:
    """A display whose image plane is 20 % further away and which is 0.7 as bright: all linear in the field."""
    fields = []
    for channel, one in enumerate(phase):
        way = AngularSpectrum(SPEC.shape, SPEC.pitch, SPEC.wavelengths[channel], 1.2 * SPEC.distance)
        fields.append(way.forward(torch.polar(torch.ones_like(one), one)))
    return 0.7 * SPEC.region.crop(torch.stack(fields)).abs().square()


def bent(phase: Tensor) -> Tensor:
    """A display that bends the phase and adds light that it does not modulate."""
    return BentDisplay(SPEC).capture(phase).linear()


def test_a_kernel_learns_another_distance() -> None:
    approximator = LearnedKernel().approximator(SPEC)
    unseen = samples(SPEC, defocused, 3, seed=100)
    before = error(approximator, unseen)
    fit(approximator, samples(SPEC, defocused, 24), 300)
    assert before > 0.3
    assert error(approximator, unseen) < 0.6 * before


def test_a_model_of_the_panel_learns_what_a_kernel_cannot() -> None:
    learned_from, unseen = samples(SPEC, bent, 12), samples(SPEC, bent, 3, seed=100)
    errors = []
    for method in (LearnedKernel(), ParametricModel(), CNNPropCNN()):
        approximator = method.approximator(SPEC)
        fit(approximator, learned_from, 200)
        errors.append(error(approximator, unseen))
    kernel, parametric, network = errors
    assert parametric < 0.2 * kernel
    assert network < 0.7 * kernel


def test_a_network_sees_where_it_is_and_no_colour_but_its_own() -> None:
    torch.manual_seed(0)
    network = ColourByColour(2, 3, 1, 4)
    torch.nn.init.ones_(network.layers[-1].weight)  # type: ignore[arg-type]
    seen = torch.ones(2, 3, 20, 30)
    answer = network(seen).detach()
    assert answer.shape == (2, 1, 20, 30)
    assert answer[0, 0, 3:-3, 3:-3].std() > 0
    seen[1, :, 5:9] = 2
    changed = network(seen).detach()
    assert torch.equal(changed[0], answer[0])
    assert not torch.equal(changed[1], answer[1])
    assert torch.allclose(network.requires_grad_(False)(seen), changed, atol=1e-5)  # held, it works colour by colour
