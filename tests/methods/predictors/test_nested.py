"""That each prediction contains the one before it, and what each learns that the one before cannot."""

from __future__ import annotations

from dataclasses import replace

import pytest
import torch

from holobench_eval.display import load_profile
from holobench_eval.display.nominal import ideal_image
from holobench_eval.display.simulated.stages import StrayLight
from holobench_eval.display.training import TrainingBench, TrainingImage
from holobench_eval.methods.calibrated import patterns
from holobench_eval.methods.predictors.nested import (
    FieldNetwork,
    ImageNetwork,
    ImageTermsModel,
    NestedPrediction,
    OneRound,
)
from holobench_eval.methods.wirtinger import Wirtinger
from holobench_eval.metrics.error_budget import unexplained
from holobench_eval.study.opening import open_bench
from tests.support.small_training import Memory, pictures, small_spec

ALL = (ImageTermsModel(), ImageNetwork(), FieldNetwork())
SPEC = small_spec(colours=2)
LIGHT = torch.tensor([2.0, 5.0])


@pytest.mark.parametrize("method", ALL)
def test_before_it_has_learned_a_prediction_is_the_ideal_image(method: NestedPrediction) -> None:
    target = pictures(SPEC)[0]
    phase = 6 * torch.rand((2, *SPEC.shape), generator=torch.Generator().manual_seed(1))
    smooth = torch.nn.functional.avg_pool2d(phase[None], 9, stride=1, padding=4)[0]
    predicted = method.approximator(SPEC).image(LIGHT)(smooth)
    ideal = ideal_image(smooth, SPEC)
    assert unexplained(predicted, ideal, target) < 0.05 * unexplained(predicted, target, target)
    assert float(predicted.mean()) == pytest.approx(float((ideal / LIGHT[:, None, None]).mean()), rel=0.1)


def test_the_network_of_the_first_sees_no_phase_and_that_of_the_field_does() -> None:
    phase = 6 * torch.rand((2, *SPEC.shape), generator=torch.Generator().manual_seed(1))
    turned = phase + 1.0  # a constant phase: the same ideal image
    for method, changes in ((ImageNetwork(), False), (FieldNetwork(), True)):
        approximator = method.approximator(SPEC)
        with torch.no_grad():
            for parameter in approximator.network.parameters():
                parameter.add_(0.01)
        image = approximator.image(LIGHT)
        assert torch.allclose(image(phase), image(turned), rtol=1e-3, atol=1e-4) is not changes


def test_light_of_another_exposure_is_another_unit_of_the_same_capture() -> None:
    phase = torch.zeros(2, *SPEC.shape)
    approximator = ImageTermsModel().approximator(SPEC)
    assert torch.allclose(2 * approximator.image(2 * LIGHT)(phase), approximator.image(LIGHT)(phase), rtol=1e-4)


def test_the_error_is_squared_and_relative() -> None:
    approximator = replace(ImageTermsModel(), seed=1).approximator(SPEC)
    capture = pictures(SPEC)[0]
    assert float(approximator.error(1.1 * capture, capture)) == pytest.approx(0.01, rel=1e-4)


def test_image_terms_find_the_share_and_reach_of_stray_light(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(patterns, "Wirtinger", lambda: Wirtinger(iterations=40))
    panel, share = (120, 120), 0.4
    profile = load_profile("ideal").scaled(panel)
    one = replace(profile.panel, wavelengths=(5.17e-7,))
    profile = replace(profile, panel=one, stray_light=StrayLight(share, 0.125))
    display = open_bench(profile, panel, 0)
    images = [TrainingImage(f"picture {number}", picture) for number, picture in enumerate(pictures(display.spec, 4))]
    bench = TrainingBench(display, "image_terms", images[:3], images[3:], Memory(), None, 0)
    method = ImageTermsModel(training=OneRound(steps=400), start=Wirtinger(iterations=20))
    terms = method.prepare(bench)["terms"]
    assert terms["share"].sigmoid().tolist() == pytest.approx([share], abs=0.05)
    assert terms["reach"].exp().tolist() == pytest.approx([0.125], abs=0.02)
