"""Training lowers the loss it says, touches nothing else, and goes on from a saved state as if never stopped."""

import copy
import io
from typing import Any

import pytest
import torch
from pydantic import TypeAdapter, ValidationError
from torch import Tensor
from torch.nn import functional

from holobench_eval.core.errors import UserError
from holobench_eval.methods.hil import perceptual
from holobench_eval.methods.hil.approximator_loss import (
    ApproximatorLoss,
    LearningRates,
    adversarial_loss,
    feature_matching_loss,
    published_loss,
)
from holobench_eval.methods.hil.networks import Network
from holobench_eval.methods.hil.trainer import Trainer

TRAINED = ("proposed", "unet", "pix2pix", "pix2pixhd")


@pytest.fixture(autouse=True)
def _no_vgg(monkeypatch: pytest.MonkeyPatch, tmp_path_factory: pytest.TempPathFactory) -> None:
    folder = str(tmp_path_factory.mktemp("hub"))
    monkeypatch.setattr(torch.hub, "get_dir", lambda: folder)


@pytest.fixture(autouse=True)
def _deterministic() -> Any:
    torch.use_deterministic_algorithms(True)
    yield
    torch.use_deterministic_algorithms(False)


def small(name: Any = "proposed", loss: ApproximatorLoss | None = None, seed: int = 0, **params: Any) -> Trainer:
    return Trainer(Network(name, levels=2, width=4, **params), loss, 3, seed)


def pair(number: int = 0, size: int = 40) -> tuple[Tensor, Tensor]:
    """An ideal image and its capture: darker to one side, with fringes."""
    ideal = torch.rand(1, 3, size, size, generator=torch.Generator().manual_seed(number))
    across = torch.linspace(0, 1, size)
    return ideal, ideal * (1 - 0.5 * across) + 0.1 * torch.sin(40 * across)


def of_size(name: str, number: int = 0) -> tuple[Tensor, Tensor]:
    return pair(number, 96 if name == "pix2pixhd" else 40)


def weights(training: Trainer) -> list[Tensor]:
    modules = [training.generator, training.discriminator]
    return [value.detach().clone() for module in modules if module is not None for value in module.parameters()]


def same(left: list[Tensor], right: list[Tensor]) -> bool:
    return all(torch.equal(a, b) for a, b in zip(left, right, strict=True))


@pytest.mark.parametrize("name", TRAINED)
def test_steps_lower_the_loss_of_every_network(name: str) -> None:
    training = Trainer(Network(name, levels=2, width=16), None, 3, 0)
    losses = [training.step(*of_size(name))["l1"] for _ in range(40)]
    assert sum(losses[-5:]) < 0.8 * sum(losses[:5])


@pytest.mark.parametrize("name", ["pix2pix", "pix2pixhd"])
def test_training_goes_on_from_a_saved_state_to_identical_weights(name: str) -> None:
    """Pix2Pix has dropout, whose random numbers go on as well."""
    straight, stopped = small(name), small(name)
    for number in range(2):
        straight.step(*of_size(name, number))
        stopped.step(*of_size(name, number))
    file = io.BytesIO()
    torch.save(stopped.state_dict(), file)
    file.seek(0)
    resumed = small(name, seed=99)
    resumed.load_state_dict(torch.load(file, weights_only=True))
    for number in range(2, 4):
        assert straight.step(*of_size(name, number)) == resumed.step(*of_size(name, number))
    assert same(weights(straight), weights(resumed))


def test_dropout_is_noise_of_the_trainer_alone() -> None:
    torch.manual_seed(5)
    first = small("pix2pix")
    before = [first.step(*pair(number)) for number in range(2)]
    torch.manual_seed(6)
    state = torch.get_rng_state()
    second = small("pix2pix")
    assert [second.step(*pair(number)) for number in range(2)] == before
    assert torch.equal(torch.get_rng_state(), state)
    assert before[0]["l1"] != before[1]["l1"]


def test_the_total_is_the_weighted_sum_of_eq_20() -> None:
    losses = small().step(*pair())
    expected = 10 * losses["l1"] + 0.05 * losses["perceptual"] + 0.5 * losses["adversarial"]
    assert losses["total"] == pytest.approx(expected, rel=1e-6)
    assert all(isinstance(value, float) for value in losses.values())
    assert losses["l2"] == losses["feature_matching"] == 0
    assert losses["discriminator"] > 0


def test_the_terms_equal_their_formulas() -> None:
    training = small(loss=ApproximatorLoss(l1=2, l2=3, perceptual=0, adversarial=0))
    ideal, capture = pair()
    error = training.frozen()(ideal) - capture
    losses = training.step(ideal, capture)
    assert losses["l1"] == pytest.approx(float(error.abs().mean()), rel=1e-5)
    assert losses["l2"] == pytest.approx(float(error.square().mean()), rel=1e-5)
    assert losses["total"] == pytest.approx(2 * losses["l1"] + 3 * losses["l2"], rel=1e-6)
    assert training.discriminator is None
    assert losses["discriminator"] == losses["adversarial"] == losses["perceptual"] == 0


def test_cross_entropy_is_of_the_sigmoid_and_least_squares_of_the_logit() -> None:
    logits = torch.tensor([[[[-2.0, 0.5], [3.0, -0.1]]]])
    for wanted in (0.0, 1.0):
        probability = torch.sigmoid(logits)
        expected = -(wanted * probability.log() + (1 - wanted) * (1 - probability).log()).mean()
        assert torch.allclose(adversarial_loss([[logits]], wanted, "cross_entropy"), expected)
        squares = ((logits - wanted) ** 2).mean()
        assert torch.allclose(adversarial_loss([[logits], [logits]], wanted, "least_squares"), 2 * squares)


def test_feature_matching_sums_mean_differences_without_the_logits() -> None:
    ours = [[torch.zeros(1, 2, 4, 4), torch.ones(1, 1, 2, 2)], [torch.ones(1, 1, 3, 3), torch.ones(1, 1, 1, 1)]]
    theirs = [[torch.full((1, 2, 4, 4), 0.5), torch.zeros(1, 1, 2, 2)], [torch.zeros(1, 1, 3, 3), torch.zeros(1)]]
    assert float(feature_matching_loss(ours, theirs)) == pytest.approx(1.5)


def test_each_optimiser_moves_its_own_network_by_at_most_the_published_rate() -> None:
    training = small()
    before = weights(training)

    def moved() -> list[float]:
        return [float((a - b).abs().max()) for a, b in zip(weights(training), before, strict=True)]

    training.step(*pair())
    assert max(moved()) == pytest.approx(2e-4, rel=0.01)  # Adam's first step
    training.step(*pair())  # the generator's other layers follow the last one, which is zero at first
    assert min(moved()) > 0


def test_the_generators_rate_falls_along_half_a_cosine_and_the_discriminators_stays() -> None:
    rates = LearningRates(generator=1e-3, decay=True)
    training = Trainer(Network(levels=2, width=4), None, 3, 0, rates)

    def step(progress: float) -> list[float]:
        before = weights(training)
        training.step(*pair(), progress)
        moved = [float((a - b).abs().max()) for a, b in zip(weights(training), before, strict=True)]
        split = len(list(training.generator.parameters()))
        return [max(moved[:split]), max(moved[split:])]

    assert step(0.0) == pytest.approx([1e-3, 2e-4], rel=0.01)
    generator, discriminator = step(1.0)
    assert generator == 0
    assert discriminator > 1e-4


def test_the_identity_has_losses_and_nothing_to_learn() -> None:
    training = small("identity")
    ideal, capture = pair()
    losses = [training.step(ideal, capture) for _ in range(2)]
    assert losses[0] == losses[1]
    assert losses[0]["l1"] == pytest.approx(float((ideal - capture).abs().mean()), rel=1e-6)
    training.load_state_dict(training.state_dict())


def test_networks_are_trained_with_their_published_losses(monkeypatch: pytest.MonkeyPatch) -> None:
    assert published_loss(Network()) == ApproximatorLoss(10.0, 0.0, 0.05, 0.5)
    assert published_loss(Network("unet")) == ApproximatorLoss(1.0, 0.0, 0.0, 0.0)
    assert published_loss(Network("pix2pix")) == ApproximatorLoss(100.0, 0.0, 0.0, 1.0)
    least_squares = published_loss(Network("pix2pixhd"))
    assert least_squares == ApproximatorLoss(0.0, 0.0, 0.0, 1.0, feature_matching=10.0, gan="least_squares")
    monkeypatch.setattr("holobench_eval.methods.hil.approximator_loss.find_weights", lambda: perceptual.URL)
    assert published_loss(Network("pix2pixhd")).perceptual == 10


def test_wrong_weights_and_a_loss_without_a_discriminator_to_ask_are_refused() -> None:
    for params in ({"l1": -1}, {"adversarial": float("nan")}, {"l2": float("inf")}, {"gan": "wgan"}):
        with pytest.raises(ValidationError):
            TypeAdapter(ApproximatorLoss).validate_python(params)
    with pytest.raises(UserError, match="'unet' has no discriminator; set 'adversarial' to 0"):
        small("unet", ApproximatorLoss())
    with pytest.raises(UserError, match="every weight is 0"):
        ApproximatorLoss(0, 0, 0, 0)


def test_images_of_two_shapes_and_a_state_that_does_not_fit_are_refused() -> None:
    training = small()
    with pytest.raises(ValueError, match="differ in shape"):
        training.step(pair()[0], pair(size=48)[1])
    training.step(*pair())
    state: Any = training.state_dict()
    moments = copy.deepcopy(state)
    moments["optimisers"]["generator"][0]["exp_avg"] = torch.zeros(1)
    other = Trainer(Network(levels=3, width=4), None, 3, 0).state_dict()
    for wrong in ({}, other, moments, state | {"noise": torch.zeros(3)}, state | {"perceptual": "vgg19"}, [1, 2]):
        with pytest.raises(UserError, match="the saved training does not fit") as caught:
            small().load_state_dict(wrong)
        assert "\n" not in str(caught.value)


def test_a_discriminator_learns_to_tell_predictions_from_captures_in_steps_of_its_own() -> None:
    training = small()
    ideal, capture = pair()
    training._step_generator(training.generator(ideal), ideal, capture)
    assert all(value.grad is None for value in training.discriminator.parameters())
    fake = torch.zeros_like(capture)
    losses = [training._step_discriminator(fake, ideal, capture) for _ in range(30)]
    assert losses[-1] < 0.5 * losses[0]
    verdict = functional.sigmoid(training.discriminator(capture, ideal)).mean()
    assert float(verdict.detach()) > 0.6


def test_moments_are_laid_out_as_the_weights() -> None:
    """A file may hold them in another order, which a fused step would take for the weights' own."""
    training = small()
    training.step(*pair())
    state = copy.deepcopy(training.state_dict())
    for values in state["optimisers"]["generator"].values():
        values["exp_avg"] = values["exp_avg"].contiguous()
    resumed = small()
    resumed.load_state_dict(state)
    assert training.step(*pair(1)) == resumed.step(*pair(1))
    assert same(weights(training), weights(resumed))
