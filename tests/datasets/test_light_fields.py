"""Light fields: what moves in a view, by how much and which way, and that the light of a display moves as it does."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from torch import Tensor

from holobench_eval.datasets import still_life
from holobench_eval.datasets.focal_stacks import BLUR, FocalStacks
from holobench_eval.datasets.light_fields import PUPIL, LightFields
from holobench_eval.display import load_profile
from holobench_eval.display.simulated.changes import altered, kinds
from holobench_eval.display.simulated.pipeline import SimulatedBench

SHAPE = (96, 96)


def test_the_view_of_the_middle_is_the_picture_of_an_eye_with_that_pupil() -> None:
    (middle,) = LightFields(places=(0.0,)).items()
    stack = FocalStacks(planes=(0.0,), near=10, far=-10, blur=BLUR * PUPIL)
    assert torch.equal(LightFields(places=(0.0,)).load(middle, SHAPE), stack.load("shapes@0mm", SHAPE))
    assert PUPIL == kinds.PUPIL


@pytest.mark.parametrize("parallax", [-0.1, 0.06])
def test_every_point_of_a_scene_moves_by_its_depth_and_what_is_near_hides_what_is_far(parallax: float) -> None:
    still, height = 0.5, 200
    before, after = (still_life.still_life("shapes", (height, height), by, still) for by in (0.0, parallax))
    rows, columns = np.mgrid[:height, :height]
    nearness = before[1]
    seen = np.rint(columns - parallax * (nearness - still) * height).astype(int)
    inside = (seen >= 0) & (seen < height)
    there = after[1][rows[inside], seen[inside]]
    same = np.abs(there - nearness[inside]) < 0.02
    assert same.mean() > 0.9  # the rest is hidden now
    assert (there[~same] > nearness[inside][~same]).mean() > 0.8  # by what is nearer; others stand at edges
    colours = np.abs(after[0][rows[inside], seen[inside]] - before[0][inside])[same]
    assert np.median(colours) < 0.01


@pytest.mark.parametrize("place", [-0.5, 0.5])
def test_a_point_before_the_picture_moves_on_a_display_as_in_the_light_field(place: float) -> None:
    profile = load_profile("ideal")
    profile = replace(profile, panel=replace(profile.panel, wavelengths=(517e-9,)))
    spec = profile.spec((192, 192))
    away = 10 * spec.distance / profile.panel.distance  # mm nearer to the viewer, on this panel
    lens = focused(replace(spec, distance=spec.distance + away * 1e-3))
    shift = centroid(eye(profile, place).image(lens)) - centroid(eye(profile, 0.0).image(lens))
    height = spec.region.shape[0]
    assert shift == pytest.approx(-place * BLUR / 2 * 10 * height, rel=0.1)


def focused(spec) -> Tensor:
    """The phase ``(1, H, W)`` of a lens that gathers the light of the panel in its distance."""
    y, x = (torch.arange(n, dtype=torch.float64) - (n - 1) / 2 for n in spec.shape)
    squared = (y[:, None] ** 2 + x**2) * spec.pitch**2
    return (-torch.pi * squared / (spec.wavelengths[0] * spec.distance)).remainder(2 * torch.pi)[None].float()


def eye(profile, place: float) -> SimulatedBench:
    return SimulatedBench(altered(profile, "eye_pupil", f"{place:g}").scaled((192, 192)))


def centroid(image: Tensor) -> float:
    """Column in which the middle of the light lies [px]."""
    light = image[0].sum(0)
    return float((light * torch.arange(len(light))).sum() / light.sum())


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"scenes": ("motorcycle",)}, "scene 'motorcycle' has one view; allowed: shapes, shapes-2, shapes-3 ..."),
        ({"places": (0.5, 0.5000001)}, "place '0.5' is given twice"),
        ({"near": -10.0}, "near is to be larger than far"),
    ],
)
def test_what_has_no_views_is_refused(change, words: str) -> None:
    with pytest.raises(Exception, match="^" + words.replace(".", r"\.")):
        LightFields(**change)
