"""What frames of random phase gain on an ideal panel: for a picture, for the planes of a stack and for an eye aside."""

from dataclasses import replace
from functools import cache
from typing import Any

import pytest
import torch
from torch import Tensor

from holobench_eval.core.errors import UserError
from holobench_eval.datasets.focal_stacks import FocalStacks
from holobench_eval.datasets.photographs import Photographs
from holobench_eval.display import load_profile
from holobench_eval.display.nominal import ideal_light
from holobench_eval.display.simulated.changes import altered
from holobench_eval.display.simulated.pipeline import SimulatedBench
from holobench_eval.methods.coarse.levels import Levels
from holobench_eval.methods.common import matched, unit_field
from holobench_eval.methods.frames.focal_stack import FocalStack
from holobench_eval.methods.frames.light_field import LightField
from holobench_eval.methods.frames.random_frames import RandomFrames
from holobench_eval.methods.multi_plane import MultiPlane
from holobench_eval.methods.wirtinger import Wirtinger
from holobench_eval.metrics.psnr import psnr
from tests.support.open_loop import Bench

IDEAL = load_profile("ideal")
PROFILE = replace(IDEAL, panel=replace(IDEAL.panel, wavelengths=(517e-9,)))
SPEC = PROFILE.spec((128, 128))
TARGET = Photographs(names=("camera",)).load("camera", SPEC.region.shape)[1:2].float()
SCENE = FocalStacks(planes=(-1.5, 0.0, 1.5), blur=0.03)
STACK = torch.stack([SCENE.load(item, SPEC.region.shape)[1:2].float() for item in SCENE.items()])
OFFSETS = [SCENE.plane(item) * 1e-3 * SPEC.distance / IDEAL.panel.distance for item in SCENE.items()]


@cache
def solved(method: Any) -> Tensor:
    """Frames ``(F, 1, H, W)`` for the picture."""
    return method.solve(TARGET[None], Bench(SPEC))[0].reshape(-1, 1, *SPEC.shape)


def quality(light: Tensor, target: Tensor = TARGET) -> float:
    """PSNR [dB] of light in the image plane, in the region."""
    return float(psnr(matched(SPEC.region.crop(light), target).clamp(0, 1), target))


def of_picture(method: Any) -> float:
    return quality(ideal_light(solved(method), SPEC))


def test_frames_alone_do_not_depend_on_the_others_and_together_they_do_and_gain_more() -> None:
    """One smooth frame beats eight that are found alone."""
    one, eight = (RandomFrames(count, iterations=100, together=False) for count in (1, 8))
    together = RandomFrames(4, iterations=100)
    assert solved(eight).shape == (8, 1, *SPEC.shape)
    assert torch.allclose(solved(eight)[:1], solved(one), atol=1e-3)
    assert not torch.allclose(solved(together)[:1], solved(one), atol=1e-3)
    assert of_picture(one) + 2 < of_picture(eight) < of_picture(Wirtinger(iterations=100))
    assert of_picture(together) > of_picture(eight) + 2


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
    counts = (1, 2, 4, 8)
    assert [error(count) for count in counts] == pytest.approx([bias + variance / n for n in counts], rel=0.05)
    assert error(4) > error(1) / 4  # not as 1 / N alone


def worst(frames: Tensor) -> float:
    """PSNR [dB] over the whole picture, at the plane of the stack where it is least."""
    planes = (replace(SPEC, distance=SPEC.distance + offset) for offset in OFFSETS)
    images = (ideal_light(frames.reshape(-1, 1, *SPEC.shape), there).mean(0) for there in planes)
    return min(quality(image, target) for image, target in zip(images, STACK, strict=True))


def test_more_frames_are_nearer_to_a_focal_stack_and_nearer_than_one_smooth_hologram() -> None:
    few, many = (FocalStack(count, iterations=80).solve_planes(STACK, OFFSETS, Bench(SPEC)) for count in (1, 4))
    assert few.shape == (1, *SPEC.shape)
    assert many.shape == (4, 1, *SPEC.shape)
    smooth = MultiPlane(iterations=80).solve_planes(STACK, OFFSETS, Bench(SPEC))
    assert worst(many) > worst(few) + 2
    assert worst(many) > worst(smooth) + 2


def test_one_plane_is_what_frames_for_the_picture_are() -> None:
    stack, bench = FocalStack(2, iterations=10), Bench(SPEC)
    alone, picture = (method.solve(STACK[1:2], bench) for method in (stack, RandomFrames(2, iterations=10)))
    assert torch.allclose(alone, picture, atol=1e-4)
    assert torch.allclose(stack.solve_planes(STACK[1:2], [0.0], bench), alone[0], atol=1e-4)


@cache
def eye(place: str) -> SimulatedBench:
    return SimulatedBench(altered(PROFILE, "eye_pupil", place).scaled(SPEC.shape))


def seen(method: Any, place: str) -> float:
    """PSNR [dB] of what the simulated bench shows an eye whose pupil is at a place."""
    return quality(torch.stack([eye(place).image(frame) for frame in solved(method)]).mean(0))


def test_four_frames_of_a_light_field_beat_four_for_the_picture_and_off_centre_a_smooth_one() -> None:
    """Between the places that they are supervised at, too; without rings only the middle has the picture."""
    field, picture = LightField(4, iterations=100), RandomFrames(4, iterations=100)
    for place, gain in {"0": 2.0, "0.375": 2.0, "0.5": 6.0}.items():
        assert seen(field, place) > seen(picture, place) + gain
    assert seen(field, "0.5") > seen(Wirtinger(iterations=100), "0.5") + 6
    middle = LightField(2, rings=0, iterations=100)
    assert seen(middle, "0") > seen(middle, "0.5") + 10
