"""What drifts while photographs are taken is told apart from the display."""

from __future__ import annotations

from dataclasses import replace

import pytest
import torch

from holobench_eval.methods.calibrated.approximator import PredictedCapture, Rates
from holobench_eval.methods.calibrated.patterns import random_phase
from holobench_eval.methods.learned.samples import Sample
from holobench_eval.methods.twin.drift import TwinApproximator, taken
from holobench_eval.methods.twin.model import TwinCamera, TwinModel, picked
from tests.support.small_training import small_spec

SPEC = small_spec(size=64, region=48)
COUNT, DRIFT, POWER = 24, (1.5, -1.0), 0.05  # photographs; px in 100 of them; rms


def photographs(drift: tuple[float, float], power: float) -> list[Sample]:
    """Of a nominal display: three of one hologram, and others between."""
    draw, camera = torch.Generator().manual_seed(1), TwinCamera(SPEC)
    shown = PredictedCapture(TwinModel(SPEC), None, camera)
    phases = [random_phase(1, SPEC.shape, 4.0, draw) for _ in range(COUNT)]
    phases[COUNT // 2] = phases[-1] = phases[0]
    light = torch.ones(1)
    samples = [Sample(phase, light, light, light, number) for number, phase in enumerate(phases)]
    with torch.no_grad():
        camera.drift.copy_(torch.tensor(drift))
        for number, sample in enumerate(samples):
            with taken(camera, sample):
                bright = 1 + power * float(torch.randn((), generator=draw))
                samples[number] = replace(sample, capture=bright * shown(sample.phase, light))
    return samples


def fitted(samples: list[Sample], exposed: bool = True) -> TwinApproximator:
    approximator = TwinApproximator(SPEC, Rates(model=3e-3, terms=5e-2))
    if exposed:
        approximator.steadied([samples[number] for number in (0, COUNT // 2, COUNT - 1)])
    for step in range(8 * COUNT):
        approximator.step(samples[step % COUNT], step / (8 * COUNT))
    return approximator


def test_a_picture_that_moves_is_found_and_left_out_of_the_display() -> None:
    samples = photographs(DRIFT, 0.0)
    approximator = fitted(samples)
    assert approximator.terms.drift.tolist() == pytest.approx(DRIFT, abs=0.25)
    assert float(approximator.terms.moved.abs().max()) < 0.1
    with torch.no_grad():  # as it was registered
        predicted = approximator.image(samples[0].light)(samples[0].phase)
    assert float((predicted - samples[0].capture).norm() / samples[0].capture.norm()) < 0.05


def test_power_that_varies_is_told_by_one_hologram_and_not_learned() -> None:
    samples = photographs((0.0, 0.0), POWER)
    known, unknown = fitted(samples), fitted(samples, exposed=False)
    assert float(known.terms.power) == pytest.approx(POWER, rel=0.8)
    assert float(unknown.terms.power) == 0
    last = [float(each.step(sample, 1.0)["l1"]) for each in (known, unknown) for sample in samples[:8]]
    assert sum(last[:8]) < 0.5 * sum(last[8:])


def test_the_light_of_a_display_whose_power_varies_is_found() -> None:
    samples = [replace(sample, capture=0.7 * sample.capture) for sample in photographs((0.0, 0.0), POWER)]
    approximator = fitted(samples)
    with torch.no_grad():
        predicted = torch.stack([approximator.image(sample.light)(sample.phase).mean() for sample in samples])
    wanted = torch.stack([sample.capture.mean() for sample in samples])
    assert float(predicted.mean() / wanted.mean()) == pytest.approx(1.0, abs=0.02)


def test_captures_of_a_steady_display_have_their_full_brightness() -> None:
    approximator = fitted(photographs((0.0, 0.0), 0.0))
    assert float(approximator.terms.power) < 1e-6
    assert approximator.terms.drift.abs().max() < 0.1


def test_captures_that_are_held_out_are_predicted_where_the_picture_was() -> None:
    samples, approximator = photographs(DRIFT, 0.0), TwinApproximator(SPEC, Rates(model=1e-3))
    with torch.no_grad():
        approximator.terms.drift.copy_(torch.tensor(DRIFT))
        for sample in samples[-4:]:
            assert torch.allclose(approximator.predicted(sample), sample.capture, atol=1e-5)


def test_pixels_are_picked_as_torch_samples_them() -> None:
    draw = torch.Generator().manual_seed(2)
    image, at = torch.rand(2, 9, 12, generator=draw), 16 * torch.rand(2, 5, 6, generator=draw) - 2
    grid = torch.stack([2 * at[1] / 11 - 1, 2 * at[0] / 8 - 1], -1).expand(2, -1, -1, -1)
    wanted = torch.nn.functional.grid_sample(image[:, None], grid, "bilinear", "border", align_corners=True)[:, 0]
    assert torch.allclose(picked(image, at), wanted, atol=1e-5)
