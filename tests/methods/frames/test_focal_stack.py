"""What frames of random phase gain by the pictures of all planes, in and out of focus, on an ideal panel."""

from __future__ import annotations

from dataclasses import replace

import torch
from torch import Tensor

from holobench_eval.datasets.focal_stacks import FocalStacks
from holobench_eval.display import load_profile
from holobench_eval.display.nominal import ideal_light
from holobench_eval.methods.common import matched
from holobench_eval.methods.frames.focal_stack import FocalStack
from holobench_eval.methods.frames.random_frames import RandomFrames
from holobench_eval.methods.multi_plane import MultiPlane
from holobench_eval.metrics.psnr import psnr
from tests.support.open_loop import Bench

SPEC = replace(load_profile("ideal").spec((128, 128)), wavelengths=(517e-9,))
SCENE = FocalStacks(planes=(-1.5, 0.0, 1.5), blur=0.03)
STACK = torch.stack([SCENE.load(item, SPEC.region.shape)[1:2].float() for item in SCENE.items()])
FULL = load_profile("ideal").panel.distance
OFFSETS = [SCENE.plane(item) * 1e-3 * SPEC.distance / FULL for item in SCENE.items()]


def worst(frames: Tensor) -> float:
    """PSNR [dB] over the whole picture, at the plane where it is least."""
    seen = []
    for offset, target in zip(OFFSETS, STACK, strict=True):
        there = replace(SPEC, distance=SPEC.distance + offset)
        light = ideal_light(frames.reshape(-1, 1, *SPEC.shape), there).mean(0)
        seen.append(float(psnr(matched(SPEC.region.crop(light), target).clamp(0, 1), target)))
    return min(seen)


def test_more_frames_are_nearer_to_the_stack_and_nearer_than_one_smooth_hologram() -> None:
    few, many = (FocalStack(count, iterations=80).solve_planes(STACK, OFFSETS, Bench(SPEC)) for count in (1, 4))
    assert few.shape == (1, *SPEC.shape)
    assert many.shape == (4, 1, *SPEC.shape)
    smooth = MultiPlane(iterations=80).solve_planes(STACK, OFFSETS, Bench(SPEC))
    assert worst(many) > worst(few) + 2
    assert worst(many) > worst(smooth) + 2


def test_one_plane_is_what_frames_for_the_picture_are() -> None:
    alone, picture = (method(2, iterations=10).solve(STACK[1:2], Bench(SPEC)) for method in (FocalStack, RandomFrames))
    assert torch.allclose(alone, picture, atol=1e-4)
    assert torch.allclose(
        FocalStack(2, iterations=10).solve_planes(STACK[1:2], [0.0], Bench(SPEC)), alone[0], atol=1e-4
    )
