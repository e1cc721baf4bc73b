"""With a blaze, look-up table and crosstalk meet the phase with the blaze; models and corrections know it."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
import torch
from torch import Tensor

from holobench_eval.display import load_profile
from holobench_eval.display.nominal import ideal_image
from holobench_eval.display.simulated.pipeline import SimulatedBench
from holobench_eval.display.simulated.stages import Crosstalk, LookUpTable
from holobench_eval.methods.calibrated.display_model import KNOTS, DisplayModel
from holobench_eval.methods.calibrated.phase_gamma import corrected
from holobench_eval.optics.phase import TAU

PANEL = (128, 128)
GAMMA = 1.2


def bench_with(blaze: tuple[float, float], **stages: object) -> SimulatedBench:
    ideal = load_profile("ideal").scaled(PANEL)
    return SimulatedBench(replace(ideal, panel=replace(ideal.panel, blaze=blaze, pupil=0.45), **stages))


def smooth_phase() -> Tensor:
    rows, columns = (torch.arange(side, dtype=torch.float32) for side in PANEL)
    bumps = 2.5 * torch.sin(rows[:, None] / 9) * torch.cos(columns[None] / 7) + rows[:, None] / 20
    return bumps.expand(3, -1, -1)


def unexplained(bench: SimulatedBench, model: DisplayModel) -> tuple[float, float]:
    """Squared error of the model and of the ideal image, at the best brightness, relative to the picture's power."""
    phase = smooth_phase()
    with torch.no_grad():
        seen = bench.spec.region.crop(bench.image(phase))
        images = model(phase).abs().square(), ideal_image(phase, bench.spec)
    return tuple(
        float(1 - (image * seen).sum() ** 2 / (image.square().sum() * seen.square().sum())) for image in images
    )


@pytest.mark.parametrize("blaze", [(0.0, 0.0), (0.0, 0.25), (0.2, 0.0)])
def test_the_display_model_with_the_true_crosstalk_explains_the_picture_with_and_without_a_blaze(blaze) -> None:
    bench = bench_with(blaze, sampling=3, crosstalk=Crosstalk(width=0.36))
    model = DisplayModel(bench.spec)
    with torch.no_grad():
        model.crosstalk.fill_(math.log(0.36))
    known, ideal = unexplained(bench, model)
    assert known < 0.2 * ideal  # along a blaze, the light of a pixel also changes over the band


@pytest.mark.parametrize("blaze", [(0.0, 0.0), (0.0, 0.25)])
def test_the_display_model_with_the_true_table_explains_the_picture_with_and_without_a_blaze(blaze) -> None:
    bench = bench_with(blaze, lut=LookUpTable(gamma=(GAMMA, GAMMA, GAMMA)))
    model = DisplayModel(bench.spec)
    levels = torch.linspace(0, 1, KNOTS)
    with torch.no_grad():
        model.crosstalk.fill_(math.log(1e-3))
        model.table.copy_(TAU * (levels**GAMMA - levels).expand(3, -1))
    known, ideal = unexplained(bench, model)
    assert known < 0.1 * ideal


@pytest.mark.parametrize("blaze", [(0.0, 0.0), (0.0, 0.25)])
def test_the_inverse_gamma_undoes_that_of_the_panel_with_and_without_a_blaze(blaze) -> None:
    plain = bench_with(blaze)
    curved = bench_with(blaze, lut=LookUpTable(gamma=(GAMMA, GAMMA, GAMMA)))
    phase = smooth_phase()
    with torch.no_grad():
        wanted, wrong = plain.image(phase), curved.image(phase)
        right = curved.image(corrected(phase, 1 / GAMMA, curved.spec))
    assert (right - wanted).square().mean() < 0.02 * (wrong - wanted).square().mean()
