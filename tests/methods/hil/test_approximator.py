"""The approximator's input is the ideal image, its unit the targets', its frozen copies stay, its critic learns."""

from __future__ import annotations

from typing import Any

import pytest
import torch
from torch import Tensor

from holobench_eval.core.errors import UserError
from holobench_eval.display.api import DisplaySpec, white_irradiance
from holobench_eval.display.nominal import ideal_image
from holobench_eval.methods.hil.approximator import NetworkApproximator
from holobench_eval.methods.hil.approximator_loss import ApproximatorLoss
from holobench_eval.methods.hil.critic import Critic
from holobench_eval.methods.hil.networks import Network
from holobench_eval.methods.hil.plus import HILPlus
from holobench_eval.methods.learned.retrieval import matched
from holobench_eval.methods.learned.samples import Sample
from tests.support.small_training import pictures, same, small_spec, through_a_file

SPEC = small_spec(48, 40, colours=3)
SMALL = Network(levels=2, width=4)
PLAIN = ApproximatorLoss(perceptual=0.0)


def approximator(
    network: Network = SMALL,
    spec: DisplaySpec = SPEC,
    with_critic: bool = True,
    of_amplitude: bool = False,
    seed: int = 0,
) -> NetworkApproximator:
    loss = PLAIN if network.name == "proposed" else None
    return NetworkApproximator(spec, network, loss, with_critic, seed, of_amplitude)


def phases(count: int = 1, spec: DisplaySpec = SPEC) -> list[Tensor]:
    draw = torch.Generator().manual_seed(5)
    return [2 * torch.rand(len(spec.wavelengths), *spec.shape, generator=draw) for _ in range(count)]


def samples(count: int = 2, spec: DisplaySpec = SPEC) -> list[Sample]:
    targets = pictures(spec, count)
    return [
        Sample(phase, 0.3 * target.flip(-1) + 0.1, target, white_irradiance(target, spec))
        for phase, target in zip(phases(count, spec), targets, strict=True)
    ]


@pytest.mark.parametrize("optics", [{}, {"pupil": 0.8, "distance": 8e-3}])
def test_the_input_is_the_ideal_intensity_in_the_unit_of_the_target(optics: dict[str, Any]) -> None:
    spec = small_spec(48, 40, colours=3, **optics)
    (phase,) = phases()
    light = torch.tensor([1.0, 2.0, 4.0])
    ideal = approximator(spec=spec).ideal(phase, light)
    assert torch.allclose(ideal, (ideal_image(phase, spec) / light.view(3, 1, 1))[None], atol=1e-5)


def test_the_gain_makes_the_first_captures_as_bright_as_their_targets() -> None:
    one, targets = approximator(), pictures(SPEC, 3)
    dim = torch.tensor([0.5, 0.25, 4.0]).view(3, 1, 1)
    one.expose([Sample(phases()[0], dim * target, target, torch.ones(3)) for target in targets])
    assert torch.allclose(one.gain, 1 / dim.flatten())
    given = samples(3)
    one.expose(given)
    errors = [
        sum((factor * one.gain.view(3, 1, 1) * s.capture - s.target).square().sum((1, 2)) for s in given)
        for factor in (1.0, 0.99, 1.01)
    ]
    assert (torch.as_tensor(errors[0]) < torch.minimum(torch.as_tensor(errors[1]), torch.as_tensor(errors[2]))).all()


def test_an_untrained_network_predicts_the_ideal_image_as_bright_as_the_captures() -> None:
    one, given = approximator(), samples(3)
    one.expose(given)
    for sample in given:
        with torch.no_grad():
            predicted, ideal = one.image(sample.light)(sample.phase), one.ideal(sample.phase, sample.light)[0]
        assert torch.allclose(predicted, ideal / one.gain.view(3, 1, 1), atol=1e-6)
    targets = torch.stack([sample.target for sample in given])
    shown = torch.stack([one.ideal(sample.phase, sample.light)[0] for sample in given])
    assert torch.allclose((shown * targets).sum((0, 2, 3)), shown.square().sum((0, 2, 3)), rtol=1e-4)


def test_amplitudes_are_learned_as_square_roots_and_squared_back(monkeypatch: pytest.MonkeyPatch) -> None:
    one = approximator(with_critic=False, of_amplitude=True)
    (sample,) = samples(1)
    one.gain = torch.tensor([2.0, 1.0, 0.5])
    seen: list[tuple[Tensor, Tensor]] = []

    def step(ideal: Tensor, capture: Tensor, progress: float) -> dict[str, float]:
        seen.append((ideal, capture))
        return {}

    monkeypatch.setattr(one.trainer, "step", step)
    one.step(sample, 0.0)
    ((ideal, capture),) = seen
    assert torch.allclose(ideal.square(), one.ideal(sample.phase, sample.light), atol=1e-5)
    assert torch.allclose(capture.square()[0], one.gain.view(3, 1, 1) * sample.capture, atol=1e-5)
    predicted = one.trainer.generator(ideal)[0]
    expected = predicted.square() / one.gain.view(3, 1, 1)
    assert torch.allclose(one.image(sample.light)(sample.phase), expected, atol=1e-6)


def test_dark_noise_has_an_amplitude() -> None:
    one = approximator(with_critic=False, of_amplitude=True)
    (sample,) = samples(1)
    black = Sample(sample.phase, torch.full_like(sample.capture, -0.01), sample.target, sample.light)
    assert all(value == value for value in one.step(black, 0.0).values())


def made(kind: str, seed: int = 0) -> Any:
    if kind == "plus":
        return HILPlus(network=SMALL, seed=seed).approximator(SPEC)
    return approximator(Network("pix2pix", levels=2, width=4) if kind == "dropout" else SMALL, seed=seed)


@pytest.mark.parametrize("kind", ["network", "dropout", "plus"])
def test_a_frozen_display_does_not_change_when_training_goes_on_and_has_a_gradient_in_the_phase_alone(
    kind: str,
) -> None:
    one, given = made(kind), samples(2)
    for sample in given:
        one.step(sample, 0.0)
    frozen = one.image(given[0].light)
    before = frozen(given[0].phase).detach().clone()
    for sample in given:
        one.step(sample, 0.0)
    assert torch.equal(frozen(given[0].phase).detach(), before)
    assert not torch.equal(one.image(given[0].light)(given[0].phase).detach(), before)
    one, phase = made(kind), given[0].phase.clone().requires_grad_()
    one.image(given[0].light)(phase).square().sum().backward()
    assert phase.grad.isfinite().all()
    assert phase.grad.abs().max() > 0
    network = one.network if kind == "plus" else one.trainer.generator
    assert all(value.grad is None for value in network.parameters())


@pytest.mark.parametrize("kind", ["network", "plus"])
def test_what_was_learned_gives_the_same_display_to_another(kind: str) -> None:
    one, (sample,) = made(kind), samples(1)
    one.expose([sample])
    one.step(sample, 0.0)
    other = made(kind, seed=9)
    other.load_learned(through_a_file(one.learned()))
    views = [each.image(sample.light)(sample.phase).detach() for each in (one, other)]
    assert torch.equal(*views)


def refuses(load: Any, weights: Any) -> None:
    with pytest.raises(UserError, match="not the weights of this network") as caught:
        load(weights)
    assert "\n" not in str(caught.value)


def test_what_another_network_or_another_display_learned_is_refused_in_one_line() -> None:
    learned = approximator().learned()
    refuses(approximator(Network(levels=2, width=6)).load_learned, learned)
    refuses(approximator(Network(levels=3, width=4)).load_learned, learned)
    refuses(approximator(spec=small_spec(48, 40, colours=1)).load_learned, learned)
    refuses(approximator().load_learned, approximator(with_critic=False).learned())
    for damaged in ({}, {**learned, "generator": None}, {**learned, "judge": {"layers": 1}}):
        refuses(approximator().load_learned, damaged)
    learned = made("plus").learned()
    refuses(HILPlus(network=Network(levels=2, width=6)).approximator(SPEC).load_learned, learned)
    refuses(HILPlus(network=SMALL).approximator(small_spec(48, 40)).load_learned, learned)
    refuses(made("plus").load_learned, HILPlus().approximator(SPEC).learned())


@pytest.mark.parametrize("network", [SMALL, Network(levels=2, width=4, full_resolution_stage=False)])
def test_the_residual_network_starts_at_nothing_and_learns(network: Network) -> None:
    """The second ends in a transposed convolution."""
    (sample,) = samples(1)
    one, alone = (HILPlus(network=wanted, seed=0).approximator(SPEC) for wanted in (network, None))
    views = [each.image(sample.light)(sample.phase).detach() for each in (one, alone)]
    assert torch.equal(*views)
    one.step(sample, 0.0)
    one.step(sample, 0.0)
    assert any(value.grad is not None and value.grad.abs().max() > 0 for value in one.network.parameters())


@pytest.mark.parametrize("network", [Network(levels=4, width=4, dropout=True), Network("pix2pix", levels=2, width=4)])
def test_a_residual_network_with_dropout_is_refused(network: Network) -> None:
    with pytest.raises(UserError, match="dropout"):
        HILPlus(network=network, seed=0).approximator(SPEC)


def test_seeds_draw_the_weights_and_leave_torchs_random_numbers_alone() -> None:
    state = torch.get_rng_state()
    first, again, other = (through_a_file(approximator(seed=seed).learned()) for seed in (0, 0, 1))
    assert same(first, again)
    assert not same(first["generator"], other["generator"])
    assert not same(first["judge"], other["judge"])
    assert torch.equal(torch.get_rng_state(), state)


def test_the_critic_learns_to_tell_targets_from_noise() -> None:
    critic, targets = Critic(3, Network(width=8), seed=0), pictures(SPEC, 6)
    draw = torch.Generator().manual_seed(2)
    noises = torch.rand(targets.shape, generator=draw)
    losses = [critic.step(noises[n % 4][None], targets[n % 4][None]) for n in range(40)]
    assert sum(losses[-4:]) < 0.5 * sum(losses[:4])
    for target, noise in zip(targets[4:], noises[4:], strict=True):  # not seen in training
        assert float(critic.verdict(target[None])) < float(critic.verdict(noise[None]))


def test_the_critic_is_shown_predictions_as_bright_as_their_targets(monkeypatch: pytest.MonkeyPatch) -> None:
    one, (sample,) = approximator(), samples(1)
    seen: list[tuple[Tensor, Tensor]] = []

    def step(picture: Tensor, target: Tensor) -> float:
        seen.append((picture, target))
        return 0.5

    monkeypatch.setattr(one.critic, "step", step)
    losses = one.step(sample, 0.0)
    ((picture, target),) = seen
    assert losses["judge"] == 0.5
    assert torch.equal(target[0], sample.target)
    predicted = one.trainer.generator(one.ideal(sample.phase, sample.light))[0].detach()
    assert torch.allclose(picture[0], matched(predicted, sample.target), atol=1e-5)


@pytest.mark.parametrize("of_amplitude", [False, True])
def test_the_identity_predicts_the_ideal_image_in_the_unit_of_captures(of_amplitude: bool) -> None:
    one = approximator(Network("identity"), with_critic=False, of_amplitude=of_amplitude)
    (phase,) = phases()
    light = torch.tensor([1.0, 2.0, 3.0])
    one.gain = torch.tensor([2.0, 4.0, 8.0])
    assert torch.allclose(one.image(light)(phase), one.ideal(phase, light)[0] / one.gain.view(3, 1, 1), atol=1e-6)
