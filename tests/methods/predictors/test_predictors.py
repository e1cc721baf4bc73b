"""Each prediction contains the one before it and learns more; a veil has the two numbers of its display."""

from dataclasses import replace

import pytest
import torch

from holobench_eval.display import load_profile
from holobench_eval.display.api import Region
from holobench_eval.display.nominal import ideal_image
from holobench_eval.display.simulated.stages import StrayLight
from holobench_eval.display.training import TrainingBench, TrainingImage
from holobench_eval.methods.calibrated import patterns
from holobench_eval.methods.calibrated.patterns import dark_patterns
from holobench_eval.methods.predictors import nested
from holobench_eval.methods.predictors.veil import REACHES, WirtingerVeil, fitted, veiled
from holobench_eval.methods.wirtinger import Wirtinger
from holobench_eval.metrics.error_budget import unexplained
from holobench_eval.study.opening import open_bench
from tests.support.small_training import Memory, pictures, small_spec

ALL = (nested.ImageTermsModel(), nested.ImageNetwork(), nested.FieldNetwork())
SPEC = small_spec(colours=2)
LIGHT = torch.tensor([2.0, 5.0])


@pytest.mark.parametrize("method", ALL)
def test_before_it_has_learned_a_prediction_is_the_ideal_image(method: nested.NestedPrediction) -> None:
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
    for method, changes in ((nested.ImageNetwork(), False), (nested.FieldNetwork(), True)):
        approximator = method.approximator(SPEC)
        with torch.no_grad():
            for parameter in approximator.network.parameters():
                parameter.add_(0.01)
        image = approximator.image(LIGHT)
        assert torch.allclose(image(phase), image(turned), rtol=1e-3, atol=1e-4) is not changes


def test_light_of_another_exposure_is_another_unit_and_the_error_is_squared_and_relative() -> None:
    phase, capture = torch.zeros(2, *SPEC.shape), pictures(SPEC)[0]
    approximator = replace(nested.ImageTermsModel(), seed=1).approximator(SPEC)
    assert torch.allclose(2 * approximator.image(2 * LIGHT)(phase), approximator.image(LIGHT)(phase), rtol=1e-4)
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
    method = nested.ImageTermsModel(training=nested.OneRound(steps=250), start=Wirtinger(iterations=20))
    terms = method.prepare(bench)["terms"]
    assert terms["share"].sigmoid().tolist() == pytest.approx([share], abs=0.05)
    assert terms["reach"].exp().tolist() == pytest.approx([0.125], abs=0.02)


PANEL = (128, 128)


@pytest.mark.parametrize(
    ("share", "reach", "black"), [(0.0, REACHES[20], 0.05), (0.3, REACHES[24], 0.0), (0.7, REACHES[12], 0.05)]
)
def test_a_veil_is_found_at_any_brightness_and_black_level(share: float, reach: float, black: float) -> None:
    draw = torch.Generator().manual_seed(1)
    region, light = Region(16, 16, 96, 96), torch.rand(3, 1, 128, 128, generator=draw)
    light[:, :, :, 64:] = 0
    captures = 0.6 * region.crop(veiled(light, share, reach)) + black
    found, far = fitted(light, captures, region)
    assert found == pytest.approx(share, abs=0.005)
    assert share == 0 or far == reach


def test_most_of_every_pattern_is_dark() -> None:
    for pattern in dark_patterns(torch.zeros(104, 96)).values():
        assert set(pattern.unique().tolist()) == {0.0, 1.0}
        assert float(pattern.mean()) <= 0.5


def test_a_veil_keeps_the_light_that_stays_in_the_picture() -> None:
    light = torch.zeros(1, 96, 96)
    light[:, 44:52, 44:52] = 1
    assert float(veiled(light, 0.5, 0.05).sum()) == pytest.approx(64, rel=1e-3)
    assert torch.equal(veiled(light, 0.0, 0.1), light)


def test_the_numbers_are_those_of_a_display_and_cost_three_captures() -> None:
    display = open_bench(replace(load_profile("ideal").scaled(PANEL), stray_light=StrayLight(0.5, 0.125)), PANEL, 0)
    image = TrainingImage("any", torch.full((3, 104, 104), 0.5))
    bench = TrainingBench(display, "veil", [image], [image], Memory(), 3, 0)
    learned = WirtingerVeil().prepare(bench)
    assert bench.captures == 3
    assert learned["share"] == pytest.approx(0.5, abs=0.02)
    assert learned["reach"] == pytest.approx(0.125, rel=0.1)
