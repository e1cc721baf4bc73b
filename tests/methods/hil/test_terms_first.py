"""What hil_terms predicts of haze is what a display does, so that a retrieval through it is control."""

from __future__ import annotations

from dataclasses import replace

import pytest
import torch
from torch import Tensor

from holobench_eval.display import load_profile
from holobench_eval.display.calibrated import CalibratedBench
from holobench_eval.display.simulated.stages import StrayLight
from holobench_eval.display.training import TrainingBench, TrainingImage
from holobench_eval.methods.calibrated import patterns
from holobench_eval.methods.calibrated.patterns import dark_patterns
from holobench_eval.methods.hil.networks import Network
from holobench_eval.methods.hil.terms_first import HILTerms, WithoutCritic
from holobench_eval.methods.learned.samples import Schedule
from holobench_eval.methods.wirtinger import Wirtinger
from holobench_eval.study.opening import open_bench
from tests.support.small_training import Memory, pictures

PANEL = (120, 120)
SHORT = HILTerms(
    training=Schedule(rounds=1, steps=250),
    retrieval=WithoutCritic(iterations=2),
    start=Wirtinger(iterations=20),
    network=Network("unet", levels=2, width=4),
)


def hazy_display() -> CalibratedBench:
    """Of one laser: haze is the same in each."""
    profile = load_profile("ideal").scaled(PANEL)
    panel = replace(profile.panel, wavelengths=(5.17e-7,))
    return open_bench(replace(profile, panel=panel, stray_light=StrayLight(0.5, 0.125)), PANEL, 0)


def lost_beside_the_dark(even: Tensor, half: Tensor) -> float:
    """Share of its light that the lit half loses in the sixth of it beside the dark one, against its far third, once
    the other half is dark; of captures ``(C, h, w)``."""
    width = even.shape[-1]
    near, far = slice(width // 2 + 2, width // 2 + width // 12), slice(-width // 6, None)
    ratios = [image[..., near].mean() / image[..., far].mean() for image in (even, half)]
    return float(1 - ratios[1] / ratios[0])


def test_it_loses_the_light_beside_a_dark_half_that_the_display_loses(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(patterns, "Wirtinger", lambda: Wirtinger(iterations=40))
    display = hazy_display()
    images = [TrainingImage(f"picture {number}", picture) for number, picture in enumerate(pictures(display.spec, 4))]
    bench = TrainingBench(display, "hil_terms", images[:3], images[3:], Memory(), None, 0)
    learned = SHORT.prepare(bench)
    assert bench.captures == 3 + 3 + 1

    gray = torch.full_like(images[0].target, 0.5)
    right = 1 - dark_patterns(gray[0])["left half"]
    captured, predicted = [], []
    for target in (gray, gray * right):
        handle = display.for_method(SHORT, "hil_terms", gray, "probe", 0, learned=learned)
        phase = Wirtinger().solve(target[None], handle)
        captured.append(display.rectified(display.session(("probe",), gray).capture(phase[0]), gray))
        predicted.append(SHORT.predict(phase, handle)[0])
    lost, expected = lost_beside_the_dark(*captured), lost_beside_the_dark(*predicted)
    assert lost > 0.1
    assert abs(expected - lost) < 0.2 * lost
