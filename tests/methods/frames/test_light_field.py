"""What an eye sees of a hologram from a place between those that the method was supervised at."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import pytest
import torch
from torch import Tensor

from holobench_eval.datasets.photographs import Photographs
from holobench_eval.display import load_profile
from holobench_eval.display.simulated.changes import altered
from holobench_eval.display.simulated.pipeline import SimulatedBench
from holobench_eval.methods.common import matched
from holobench_eval.methods.frames.light_field import LightField
from holobench_eval.methods.frames.random_frames import RandomFrames
from holobench_eval.methods.wirtinger import Wirtinger
from holobench_eval.metrics.psnr import psnr
from tests.support.open_loop import Bench

PROFILE = load_profile("ideal")
PROFILE = replace(PROFILE, panel=replace(PROFILE.panel, wavelengths=(517e-9,)))
SPEC = PROFILE.spec((128, 128))
TARGET = Photographs(names=("camera",)).load("camera", SPEC.region.shape)[1:2].float()


@cache
def eye(place: str) -> SimulatedBench:
    return SimulatedBench(altered(PROFILE, "eye_pupil", place).scaled(SPEC.shape))


def seen(method: object, place: str) -> float:
    """PSNR [dB] of what the simulated bench shows an eye whose pupil is at a place."""
    frames = solved(method)
    light = torch.stack([SPEC.region.crop(eye(place).image(frame)) for frame in frames]).mean(0)
    return float(psnr(matched(light, TARGET).clamp(0, 1), TARGET))


@cache
def solved(method: object) -> Tensor:
    return method.solve(TARGET[None], Bench(SPEC))[0].reshape(-1, 1, *SPEC.shape)  # type: ignore[attr-defined]


@pytest.mark.parametrize(("place", "gain"), [("0", 2.0), ("0.375", 2.0), ("0.5", 6.0)])
def test_four_frames_of_a_light_field_beat_four_for_the_picture_and_off_centre_a_smooth_one(
    place: str, gain: float
) -> None:
    field = seen(LightField(4, iterations=100), place)
    assert field > seen(RandomFrames(4, iterations=100), place) + gain
    if place == "0.5":
        assert field > seen(Wirtinger(iterations=100), place) + gain


def test_without_rings_only_the_middle_has_the_picture() -> None:
    middle = LightField(2, rings=0, iterations=100)
    assert seen(middle, "0") > seen(middle, "0.5") + 10
