"""The approximator's input is the ideal image, its unit the targets', its perceptual loss Eq. 21; its copies stay."""

import hashlib
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import torch
from torch import Tensor
from torch.nn import functional

from holobench_eval.core.errors import UserError
from holobench_eval.display.api import DisplaySpec, white_irradiance
from holobench_eval.display.nominal import ideal_image
from holobench_eval.methods.hil.approximator import NetworkApproximator
from holobench_eval.methods.hil.approximator_loss import ApproximatorLoss
from holobench_eval.methods.hil.critic import Critic
from holobench_eval.methods.hil.networks import Network
from holobench_eval.methods.hil.perceptual import VGG19, OrientedFilters, find_weights, perceptual_loss
from holobench_eval.methods.hil.plus import HILPlus
from holobench_eval.methods.learned.retrieval import matched
from holobench_eval.methods.learned.samples import Sample
from holobench_eval.metrics.base import gaussian_blur
from holobench_eval.metrics.feature_distance import opponent_channels, oriented_responses
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
    monkeypatch.undo()
    # dark noise has an amplitude, too
    black = Sample(sample.phase, torch.full_like(sample.capture, -0.01), sample.target, sample.light)
    assert all(value == value for value in one.step(black, 0.0).values())


def made(kind: str, seed: int = 0) -> Any:
    if kind == "plus":
        return HILPlus(network=SMALL, seed=seed).approximator(SPEC)
    return approximator(Network("pix2pix", levels=2, width=4) if kind == "dropout" else SMALL, seed=seed)


@pytest.mark.parametrize("kind", ["network", "dropout", "plus"])
def test_a_frozen_display_stays_when_training_goes_on_and_has_a_gradient_in_the_phase_alone(kind: str) -> None:
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
def test_the_residual_network_starts_at_nothing_learns_and_takes_no_dropout(network: Network) -> None:
    """The second ends in a transposed convolution."""
    (sample,) = samples(1)
    one, alone = (HILPlus(network=wanted, seed=0).approximator(SPEC) for wanted in (network, None))
    views = [each.image(sample.light)(sample.phase).detach() for each in (one, alone)]
    assert torch.equal(*views)
    one.step(sample, 0.0)
    one.step(sample, 0.0)
    assert any(value.grad is not None and value.grad.abs().max() > 0 for value in one.network.parameters())
    for dropout in (replace(network, dropout=True), Network("pix2pix", levels=2, width=4)):
        with pytest.raises(UserError, match="dropout"):
            HILPlus(network=dropout, seed=0).approximator(SPEC)


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


LAYERS = {0: (3, 64), 2: (64, 64), 5: (64, 128), 7: (128, 128), 10: (128, 256)}


def images(channels: int = 3, size: int = 24) -> tuple[Tensor, Tensor]:
    draw = torch.Generator().manual_seed(2)
    one, other = torch.rand(2, 2, channels, size, size, generator=draw)
    return one, other


@pytest.fixture(scope="module")
def vgg(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A file such as torchvision's, with random weights and a layer more than is needed."""
    draw, state = torch.Generator().manual_seed(3), {}
    for number, (before, after) in LAYERS.items():
        weight = torch.randn(after, before, 3, 3, generator=draw) * (2 / (9 * before)) ** 0.5
        state[f"features.{number}.weight"] = weight
        state[f"features.{number}.bias"] = torch.randn(after, generator=draw) / 10
    path = tmp_path_factory.mktemp("weights") / "vgg19-made.pth"
    torch.save(state, path)
    return path


def expected(path: Path, image: Tensor, target: Tensor) -> float:
    state = torch.load(path, weights_only=True)
    mean, deviation = torch.tensor([0.485, 0.456, 0.406]), torch.tensor([0.229, 0.224, 0.225])

    def layer(x: Tensor, number: int) -> Tensor:
        return functional.relu(
            functional.conv2d(x, state[f"features.{number}.weight"], state[f"features.{number}.bias"], padding=1)
        )

    def features(x: Tensor) -> tuple[Tensor, Tensor]:
        x = (x.expand(-1, 3, -1, -1) - mean[:, None, None]) / deviation[:, None, None]
        relu1_2 = layer(layer(x, 0), 2)
        return relu1_2, layer(layer(functional.max_pool2d(relu1_2, 2, 2), 5), 7)

    (a1, a2), (b1, b2) = features(image), features(target)
    return float(1.5 * (a1 - b1).abs().mean() + 1.0 * (a2 - b2).abs().mean())


@pytest.mark.parametrize("channels", [1, 3])
def test_vgg_equals_the_formula(vgg: Path, channels: int) -> None:
    image, target = images(channels)
    loss = VGG19(vgg)
    assert loss.name == "vgg19"
    assert float(loss(image, target)) == pytest.approx(expected(vgg, image, target), rel=1e-5)
    assert float(loss(image, target)) > 0.01


@pytest.mark.parametrize("channels", [1, 3])
def test_oriented_filters_equal_the_difference_of_rectified_features(channels: int) -> None:
    image, target = images(channels)
    total, a, b = 0.0, image, target
    for scale, weight in enumerate((1.5, 1.0)):
        mine, theirs = (oriented_responses(opponent_channels(x, scale)) for x in (a, b))
        for sign in (1, -1):
            total += weight * float(((sign * mine).clamp_min(0) - (sign * theirs).clamp_min(0)).abs().mean())
        a, b = (gaussian_blur(x, 1.0)[:, :, ::2, ::2] for x in (a, b))
    loss = OrientedFilters()
    assert loss.name == "oriented filters"
    assert float(loss(image, target)) == pytest.approx(total, rel=1e-5)


def test_identical_images_have_no_loss_and_the_loss_pulls_towards_the_target(vgg: Path) -> None:
    image, target = images()
    for loss in (OrientedFilters(), VGG19(vgg)):
        assert float(loss(target, target)) == 0
        moving = image.clone().requires_grad_()
        before = loss(moving, target)
        (slope,) = torch.autograd.grad(before, moving)
        assert slope.isfinite().all()
        assert float(loss(image - 1e-2 * slope / slope.abs().max(), target)) < float(before.detach())
        assert not any(value.requires_grad for value in loss.parameters())


def test_vgg_is_used_where_its_weights_are_in_the_hub_cache(vgg: Path, tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(torch.hub, "get_dir", lambda: str(tmp_path))
    assert find_weights() is None
    assert perceptual_loss().name == "oriented filters"
    (tmp_path / "checkpoints").mkdir()
    (tmp_path / "checkpoints" / vgg.name).symlink_to(vgg)
    assert perceptual_loss().name == "vgg19"


def test_a_bad_file_is_refused_in_one_line(vgg: Path, tmp_path: Path) -> None:
    path, state = tmp_path / "vgg19-bad.pth", torch.load(vgg, weights_only=True)
    fewer = {key: value for key, value in state.items() if ".7." not in key}
    other = state | {"features.2.weight": torch.zeros(64, 64, 1, 1)}
    infinite = state | {"features.5.bias": torch.full((128,), torch.nan)}
    # no checkpoint at all, and a pickled object: loading it would run code
    for content in (b"<html>404</html>", [1, 2], fewer, other, infinite, torch.nn.Linear(2, 2)):
        path.write_bytes(content) if isinstance(content, bytes) else torch.save(content, path)
        with pytest.raises(UserError) as caught:
            VGG19(path)
        assert "\n" not in str(caught.value)
        assert str(path) in str(caught.value)


def test_the_checksum_in_a_name_is_checked(vgg: Path, tmp_path: Path) -> None:
    content = vgg.read_bytes()
    right = tmp_path / f"vgg19-{hashlib.sha256(content).hexdigest()[:8]}.pth"
    wrong = tmp_path / "vgg19-01234567.pth"
    for path in (right, wrong):
        path.write_bytes(content)
    assert VGG19(right).name == "vgg19"
    with pytest.raises(UserError, match="checksum"):
        VGG19(wrong)
