"""Every term of Eq. 22 is what it says, and retrieval is descent on their sum from a start."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import pytest
import torch
from torch import Tensor
from torch.nn import functional

from holobench_eval.core.errors import Pending
from holobench_eval.methods.hil.critic import Critic
from holobench_eval.methods.hil.networks import Network
from holobench_eval.methods.learned import retrieval
from holobench_eval.methods.learned.retrieval import Image, PhaseRetrieval, PictureLoss, left_out, matched, retrieve
from holobench_eval.methods.learned.samples import Sample, together
from holobench_eval.metrics.feature_distance import mofd
from holobench_eval.metrics.ms_ssim import ms_ssim
from holobench_eval.optics import srgb_encode
from tests.support.small_training import pictures, small_spec

TERMS = ("perceptual", "ms_ssim", "l2", "adversarial")


@pytest.fixture(autouse=True)
def _no_lpips(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(retrieval, "available", lambda network: "no weights")


def only(term: str, weight: float = 1.0, **settings: Any) -> PhaseRetrieval:
    weights: dict[str, Any] = {**dict.fromkeys(TERMS, 0.0), term: weight}
    return PhaseRetrieval(**weights, **settings)


def double_critic(channels: int = 1) -> Critic:
    critic = Critic(channels, Network(width=4), seed=0)
    critic.network.double()
    return critic


def pair(channels: int = 1) -> tuple[Tensor, Tensor]:
    """A target and a prediction that is darker, noisy and somewhere above white, large enough for MS-SSIM."""
    target = pictures(small_spec(180, 162, channels))[0].double()
    noise = torch.randn(target.shape, dtype=torch.float64, generator=torch.Generator().manual_seed(3))
    return target, 0.3 * (target + 0.1 * noise).clamp_min(0.01)


def plain(term: str, image: Tensor, target: Tensor, critic: Critic) -> Tensor:
    """The terms by their definitions."""
    factor = (image * target).sum((1, 2), keepdim=True) / image.square().sum((1, 2), keepdim=True)
    picture = factor * image
    if term == "l2":
        return (picture - target).square().mean()
    if term == "ms_ssim":
        return 1 - ms_ssim(picture.clamp(0, 1), target)
    if term == "perceptual":
        return mofd(srgb_encode(picture.clamp(0, 1)), srgb_encode(target))
    logits = critic.network(picture[None], picture[None])
    return functional.softplus(-logits).mean()


@pytest.mark.parametrize("term", TERMS)
def test_a_term_alone_has_its_value_and_its_gradient(term: str) -> None:
    target, image = pair()
    critic = double_critic()
    loss = PictureLoss(target, only(term, 3.0), critic.verdict)
    image.requires_grad_()
    value, error = loss(image)
    expected = plain(term, image, target, critic)
    assert float(value.detach()) == pytest.approx(3 * float(expected.detach()), rel=1e-9)
    assert float(error) == pytest.approx(float(plain("l2", image.detach(), target, critic)), rel=1e-9)
    (ours,) = torch.autograd.grad(value, image)
    (theirs,) = torch.autograd.grad(3 * expected, image)
    assert (ours - theirs).norm() < 1e-9 * theirs.norm()
    assert ours.norm() > 0


def test_the_loss_is_the_weighted_sum_of_its_terms() -> None:
    target, image = pair(channels=3)
    weights: dict[str, Any] = {"perceptual": 2.0, "ms_ssim": 0.5, "l2": 7.0, "adversarial": 0.3}
    critic = double_critic(3)
    alone = [weights[term] * PictureLoss(target, only(term), critic.verdict)(image)[0] for term in TERMS]
    together = PictureLoss(target, PhaseRetrieval(**weights), critic.verdict)(image)[0]
    assert float(together) == pytest.approx(float(torch.stack(alone).sum()), rel=1e-9)


@pytest.mark.parametrize("term", TERMS)
@pytest.mark.parametrize("factor", [0.01, 100.0])
def test_the_brightness_of_a_prediction_does_not_matter(term: str, factor: float) -> None:
    target, image = pair()
    loss = PictureLoss(target, only(term), double_critic().verdict)
    assert float(loss(factor * image)[0]) == pytest.approx(float(loss(image)[0]), rel=1e-9)


def test_the_brightness_is_matched_by_least_squares_channel_by_channel() -> None:
    target, image = pair(channels=3)
    factors = torch.tensor([0.5, 2.0, 30.0], dtype=torch.float64).view(3, 1, 1)
    assert torch.allclose(matched(factors * image, target), matched(image, target))
    best = (matched(image, target) - target).square().sum((1, 2))
    for change in (0.99, 1.01):
        assert ((change * matched(image, target) - target).square().sum((1, 2)) > best).all()
    assert matched(torch.zeros_like(target), target).eq(0).all()


def test_a_black_prediction_and_a_black_target_have_a_finite_gradient() -> None:
    target, image = pair()
    for one, other in ((torch.zeros_like(image), target), (image, torch.zeros_like(target))):
        shown = one.clone().requires_grad_()
        value, _ = PictureLoss(other, PhaseRetrieval(), double_critic().verdict)(shown)
        (gradient,) = torch.autograd.grad(value, shown)
        assert gradient.isfinite().all()


def test_lpips_is_the_perceptual_term_where_its_weights_are_found(monkeypatch: pytest.MonkeyPatch) -> None:
    target, image = pair()
    seen: list[tuple[Tensor, Tensor]] = []

    def lpips(picture: Tensor, wanted: Tensor) -> Tensor:
        seen.append((picture, wanted))
        return torch.tensor([0.25, 0.75], dtype=torch.float64)

    monkeypatch.setattr(retrieval, "available", lambda network: None)
    monkeypatch.setattr(retrieval, "lpips", lpips)
    assert float(PictureLoss(target, only("perceptual", 4.0), None)(image)[0]) == 2.0
    ((picture, wanted),) = seen
    assert torch.equal(wanted, srgb_encode(target)[None])
    assert torch.equal(picture, srgb_encode(matched(image, target).clamp(0, 1))[None])


@pytest.mark.parametrize(
    ("side", "lacks"),
    [
        (161, ""),
        (160, "MS-SSIM at 1 of its 5 scales"),
        (78, "MS-SSIM at 2 of its 5 scales"),
        (52, "MS-SSIM at 2 of its 5 scales and the perceptual distance"),
    ],
)
def test_a_small_picture_has_what_fits_of_the_loss_and_the_rest_is_named(side: int, lacks: str) -> None:
    settings, target = PhaseRetrieval(), pictures(small_spec(side, side))[0]
    assert left_out((side, side), settings) == lacks
    assert left_out((side, side), replace(settings, perceptual=0, ms_ssim=0)) == ""
    loss = PictureLoss(target, settings, None)
    assert float(loss(target)[0]) == pytest.approx(0, abs=1e-4)
    assert float(loss(target.flip(1))[0]) > 0.01


class Bowl:
    """A prediction whose error is least at a phase of 1 rad everywhere; it remembers the phases it was asked about."""

    def __init__(self) -> None:
        self.target = pictures(small_spec(24, 16))[0]
        self.seen: list[Tensor] = []

    def __call__(self, phase: Tensor) -> Tensor:
        self.seen.append(phase.detach().clone())
        ripple = (-1.0) ** torch.arange(16)
        return self.target + 0.2 * ripple * (phase - 1)

    def errors(self) -> list[float]:
        asked, self.seen = self.seen, []
        errors = [float((matched(self(phase), self.target) - self.target).square().mean()) for phase in asked]
        self.seen = asked
        return errors


START = torch.full((1, 16, 16), 0.2)


def found(display: Image, **settings: Any) -> Tensor:
    return retrieve(display, display.target, START, only("l2", **settings))


def test_descent_goes_to_the_picture_and_leaves_its_start_alone() -> None:
    display, before = Bowl(), START.clone()
    phase = found(display, iterations=60, step=0.1)
    assert float((phase - 1).abs().mean()) < 0.2 * float((START - 1).abs().mean())
    assert not phase.requires_grad
    assert torch.equal(START, before)
    assert torch.equal(display.seen[0], START)


def test_the_step_is_whole_at_first_and_falls_along_half_a_cosine() -> None:
    display = Bowl()
    found(display, iterations=3, step=1e-3)
    moved = [float((b - a).abs().max()) for a, b in zip(display.seen, display.seen[1:], strict=False)]
    assert moved == pytest.approx([1e-3, 0.75e-3], rel=0.01)


def test_descent_stops_below_the_threshold() -> None:
    display = Bowl()
    found(display, iterations=60, step=0.1)
    errors = display.errors()
    threshold = errors[0] / 10
    stopping = Bowl()
    phase = found(stopping, iterations=60, step=0.1, threshold=threshold)
    first = next(number for number, error in enumerate(errors) if error < threshold)
    assert len(stopping.seen) == first + 1 < 60
    assert torch.equal(phase, stopping.seen[-1])


def test_the_best_phase_is_kept_when_later_ones_are_worse() -> None:
    display = Bowl()
    phase = found(display, iterations=3, step=2.5)
    errors = display.errors()
    best = errors.index(min(errors))
    assert best < len(errors) - 1
    assert torch.equal(phase, display.seen[best])


SAMPLE = Sample(*(torch.zeros(1),) * 4)


def kind(name: str, asked: list[str], waits: bool) -> Callable[[], Sequence[Sample]]:
    def make() -> Sequence[Sample]:
        asked.append(name)
        if waits:
            raise Pending(name)
        return [SAMPLE]

    return make


def test_every_kind_is_asked_for_before_the_first_that_waits_says_so() -> None:
    asked: list[str] = []
    with pytest.raises(Pending, match=r"^b$"):
        together(kind("a", asked, False), kind("b", asked, True), kind("c", asked, True))
    assert asked == ["a", "b", "c"]
    assert together(kind("a", [], False), kind("b", [], False)) == [SAMPLE, SAMPLE]
