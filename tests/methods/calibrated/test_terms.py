from __future__ import annotations

import math

import pytest
import torch
from torch import Tensor

from holobench_eval.display.simulated.stages.stray_light import gaussian
from holobench_eval.methods.calibrated.approximator import MODEL_BETAS
from holobench_eval.methods.calibrated.terms import Haze, ImageTerms, scattered, spread
from holobench_eval.methods.descent import cosine_decay
from holobench_eval.metrics.error_budget import unexplained
from tests.support.small_training import pictures, small_spec

SPEC = small_spec(48, 48)
STEPS = 600


def changed(intensity: Tensor) -> Tensor:
    """Vignetting, a veil and a tone curve, each as the bench or a textbook has it, not as the terms do."""
    height, width = intensity.shape[-2:]
    y, x = torch.meshgrid(torch.linspace(-1, 1, height), torch.linspace(-1, 1, width), indexing="ij")
    veil = torch.stack([gaussian(colour, 0.2 * height) for colour in intensity])
    shaded = (0.6 * intensity + 0.4 * veil) / (1 + 0.3 * (x**2 + y**2)) ** 2
    return 5 * shaded**0.8


def test_they_begin_as_the_ideal_image() -> None:
    for picture in pictures(SPEC, 3):
        held = ImageTerms(SPEC)(picture).detach()
        assert unexplained(held, picture, picture) < 0.02 * float(picture.var())


def test_shading_haze_and_tone_are_learned_and_hold_for_a_picture_that_was_not_seen() -> None:
    terms = ImageTerms(SPEC)
    optimiser = torch.optim.Adam(terms.parameters(), lr=3e-2, betas=MODEL_BETAS)
    seen, unseen = pictures(SPEC, 6), pictures(SPEC, 1, first=50)[0]
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
    haze, light = Haze(SPEC), pictures(SPEC, 1)[0]
    learned = haze(light).detach()
    assert torch.allclose(haze.requires_grad_(False)(light), learned, atol=1e-6)


def test_a_dark_picture_has_finite_gradients() -> None:
    terms = ImageTerms(small_spec(16, 16, colours=2))
    terms(torch.zeros(2, 16, 16)).sum().backward()
    assert all(bool(parameter.grad.isfinite().all()) for parameter in terms.parameters() if parameter.grad is not None)
