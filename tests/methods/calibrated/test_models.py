"""Models and terms by themselves, and the patterns that they learn from."""

import math
from collections.abc import Callable
from dataclasses import replace

import pytest
import torch
from torch import Tensor

from holobench_eval.display.api import DisplaySpec, white_irradiance
from holobench_eval.display.nominal import ideal_image
from holobench_eval.display.simulated.stages.stray_light import gaussian
from holobench_eval.methods.calibrated.approximator import MODEL_BETAS, ModelApproximator
from holobench_eval.methods.calibrated.cnn_prop_cnn import CNNPropCNN
from holobench_eval.methods.calibrated.hybrid import HybridModel
from holobench_eval.methods.calibrated.kernel import LearnedKernel
from holobench_eval.methods.calibrated.networks import ColourByColour
from holobench_eval.methods.calibrated.parametric import ParametricModel
from holobench_eval.methods.calibrated.patterns import LENGTHS, pattern_samples, random_phase
from holobench_eval.methods.calibrated.terms import Haze, ImageTerms, scattered, spread
from holobench_eval.methods.descent import cosine_decay
from holobench_eval.methods.learned.samples import Sample
from holobench_eval.metrics.error_budget import unexplained
from holobench_eval.optics import AngularSpectrum
from tests.support.small_training import BentDisplay, Memory, pictures, small_spec, training_bench

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
        fit(approximator, learned_from, 120)
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


SQUARE = small_spec(48, 48)
STEPS = 600


def changed(intensity: Tensor) -> Tensor:
    """Vignetting, a veil and a tone curve, each as the bench or a textbook has it, not as the terms do."""
    height, width = intensity.shape[-2:]
    y, x = torch.meshgrid(torch.linspace(-1, 1, height), torch.linspace(-1, 1, width), indexing="ij")
    veil = torch.stack([gaussian(colour, 0.2 * height) for colour in intensity])
    shaded = (0.6 * intensity + 0.4 * veil) / (1 + 0.3 * (x**2 + y**2)) ** 2
    return 5 * shaded**0.8


def test_they_begin_as_the_ideal_image() -> None:
    for picture in pictures(SQUARE, 3):
        held = ImageTerms(SQUARE)(picture).detach()
        assert unexplained(held, picture, picture) < 0.02 * float(picture.var())


def test_shading_haze_and_tone_are_learned_and_hold_for_a_picture_that_was_not_seen() -> None:
    terms = ImageTerms(SQUARE)
    optimiser = torch.optim.Adam(terms.parameters(), lr=3e-2, betas=MODEL_BETAS)
    seen, unseen = pictures(SQUARE, 6), pictures(SQUARE, 1, first=50)[0]
    for step in range(STEPS):
        optimiser.param_groups[0]["lr"] = cosine_decay(3e-2, step / STEPS)
        picture = seen[step % len(seen)]
        loss = (terms(picture) - changed(picture)).square().mean() / changed(picture).square().mean()
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
    before = unexplained(changed(unseen), unseen, unseen)
    assert unexplained(changed(unseen), terms(unseen).detach(), unseen) < 0.02 * before
    assert float(terms.gamma.detach().exp()) == pytest.approx(0.8, abs=0.08)


def test_a_gaussian_keeps_its_light_inside_or_loses_what_is_spread_beyond_the_end() -> None:
    widths = torch.tensor([0.3, 8.0])
    inside, open_end = spread(64, widths, lossless=True), spread(64, widths)
    assert torch.allclose(inside.sum(-1), torch.ones(2, 64))
    assert float(open_end[1, 32].sum()) == pytest.approx(1, abs=1e-3)
    assert float(open_end[1, 0].sum()) == pytest.approx(0.5 + 0.5 / (math.sqrt(math.tau) * 8), abs=1e-3)


@pytest.mark.parametrize("width", [0.5, 4.0, 25.0, 200.0])
def test_light_is_scattered_by_few_nodes_as_by_the_entire_gaussian(width: float) -> None:
    image = torch.rand(2, 48, 64, generator=torch.Generator().manual_seed(1), dtype=torch.float64)
    rows, columns = (spread(side, torch.tensor([width], dtype=torch.float64))[0] for side in (48, 64))
    assert torch.allclose(scattered(image, width), rows @ image @ columns.mT, atol=1e-7)


def test_a_held_haze_is_that_which_was_learned() -> None:
    haze, light = Haze(SQUARE), pictures(SQUARE, 1)[0]
    learned = haze(light).detach()
    assert torch.allclose(haze.requires_grad_(False)(light), learned, atol=1e-6)


def test_a_dark_picture_has_finite_gradients() -> None:
    terms = ImageTerms(small_spec(16, 16, colours=2))
    terms(torch.zeros(2, 16, 16)).sum().backward()
    assert all(bool(parameter.grad.isfinite().all()) for parameter in terms.parameters() if parameter.grad is not None)


SHAPE = (160, 192)


@pytest.mark.parametrize("length", [2.0, 4.0])
def test_every_phase_value_is_equally_likely(length: float) -> None:
    phase = random_phase(3, SHAPE, length, torch.Generator().manual_seed(0))
    assert phase.shape == (3, *SHAPE)
    assert phase.abs().max() <= math.pi + 1e-6
    counts = torch.histc(phase, bins=8, min=-math.pi, max=math.pi) / phase.numel()
    assert (counts - 1 / 8).abs().max() < 0.03


@pytest.mark.parametrize("length", [2.0, 4.0, 8.0])
def test_neighbours_agree_within_the_correlation_length_and_not_beyond(length: float) -> None:
    field = torch.polar(torch.tensor(1.0), random_phase(3, SHAPE, length, torch.Generator().manual_seed(0)))

    def agreement(distance: int) -> float:
        return float((field[:, distance:] * field[:, :-distance].conj()).mean().abs())

    assert agreement(1) > 0.75
    assert 0.5 < agreement(int(length)) < 0.8
    assert agreement(int(5 * length)) < 0.25


def test_patterns_and_colours_differ_go_through_the_correlation_lengths_and_are_captured_once() -> None:
    spec, memory = small_spec(64, 48, colours=2), Memory()
    bench = training_bench(spec, memory)
    samples = pattern_samples(bench, 5)
    assert bench.captures == 5
    phases = [phase for sample in samples for phase in sample.phase]
    assert len({float(phase.double().sum()) for phase in phases}) == 10
    steps = [float((torch.polar(torch.ones(()), phase.diff(dim=-1)) - 1).abs().mean()) for phase in phases[::2]]
    assert steps[:4] == sorted(steps[:4], reverse=True)
    assert steps[4] == pytest.approx(steps[0], rel=0.1)
    assert len(LENGTHS) == 4
    assert {float(sample.target.unique()) for sample in samples} == {0.25}  # the camera is exposed for gray
    again = pattern_samples(training_bench(spec, memory), 5)
    assert memory.fate.passed == []
    for one, other in zip(samples, again, strict=True):
        assert torch.equal(one.capture, other.capture)
