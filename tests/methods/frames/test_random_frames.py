"""What frames of random phase gain, alone and together, on an ideal panel."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import pytest
import torch
from torch import Tensor

from holobench_eval.core.errors import UserError
from holobench_eval.datasets.photographs import Photographs
from holobench_eval.display import load_profile
from holobench_eval.display.nominal import ideal_light
from holobench_eval.methods.coarse.levels import Levels
from holobench_eval.methods.common import matched, unit_field
from holobench_eval.methods.frames.random_frames import RandomFrames
from holobench_eval.methods.wirtinger import Wirtinger
from holobench_eval.metrics.psnr import psnr
from tests.support.open_loop import Bench

SPEC = replace(load_profile("ideal").spec((128, 128)), wavelengths=(517e-9,))
TARGET = Photographs(names=("camera",)).load("camera", SPEC.region.shape)[1:2].float()


@cache
def frames(count: int, together: bool = False) -> Tensor:
    return RandomFrames(count, iterations=100, together=together).solve(TARGET[None], Bench(SPEC))[0]


def quality(phase: Tensor) -> float:
    image = SPEC.region.crop(ideal_light(phase, SPEC))
    return float(psnr(matched(image, TARGET).clamp(0, 1), TARGET))


def test_frames_alone_do_not_depend_on_the_others_and_together_they_do() -> None:
    assert frames(8).shape == (8, 1, *SPEC.shape)
    assert torch.allclose(frames(8)[:1], frames(1), atol=1e-3)
    assert not torch.allclose(frames(4, together=True)[:1], frames(1), atol=1e-3)


def test_together_frames_gain_more_and_one_smooth_frame_beats_eight_alone() -> None:
    smooth = quality(Wirtinger(iterations=100).solve(TARGET[None], Bench(SPEC))[0])
    assert quality(frames(1)) + 2 < quality(frames(8)) < smooth
    assert quality(frames(4, together=True)) > quality(frames(8)) + 2


def test_frames_are_on_the_levels_of_a_published_table_and_no_more_than_a_display_shows() -> None:
    spec = replace(load_profile("plm-4bit").spec((64, 64)), wavelengths=(517e-9,))
    target = Photographs(names=("camera",)).load("camera", spec.region.shape)[None, 1:2].float()
    phase = RandomFrames(2, iterations=3).solve(target, Bench(spec))
    levels = Levels(spec, 0, phase)
    assert torch.allclose(levels.shown_by(levels.nearest(nominal_phase(phase, levels))), phase)
    with pytest.raises(UserError, match=f"frames: 99; 'plm-4bit' shows {spec.frames} at most in an exposure"):
        RandomFrames(99).refuse_display(spec)


def nominal_phase(phase: Tensor, levels: Levels) -> Tensor:
    """The phase of the light of the level that a display shows for a phase."""
    step = 2 * torch.pi / len(levels.phases)
    shown = (phase - levels.shown_by(torch.zeros_like(phase))) / step
    return levels.light(shown.round().long() % len(levels.phases))


def test_the_error_of_random_holograms_that_nothing_improves_falls_as_a_and_b_over_their_number() -> None:
    """The mean of N independent intensities has their bias, a, and their variance over N, b / N."""
    model, draw = SPEC.propagator(0), torch.Generator().manual_seed(3)
    amplitude = SPEC.region.embed(TARGET[0].sqrt(), SPEC.shape)
    starts = 2 * torch.pi * torch.rand(32, *SPEC.shape, generator=draw)
    phases = model.adjoint(amplitude * unit_field(starts)).angle()
    light = SPEC.region.crop(model.forward(unit_field(phases)).abs().square())
    light = light * (TARGET.mean() / light.mean())

    def error(count: int) -> float:
        means = light.unflatten(0, (-1, count)).mean(1)
        return float((means - TARGET).square().mean())

    variance = float(light.var(0).mean())
    bias = error(32) - variance / 32
    assert bias > 0
    assert [error(count) for count in (1, 2, 4, 8)] == pytest.approx(
        [bias + variance / count for count in (1, 2, 4, 8)], rel=0.05
    )
    assert error(4) > error(1) / 4  # not as 1 / N alone
