"""The charts, seen through what they are for."""

import pytest
import torch

from holobench_eval.core.errors import UserError
from holobench_eval.datasets import charts
from holobench_eval.datasets.charts import CHARTS, Charts
from holobench_eval.optics import srgb_encode

GOLDEN = {
    "tv_lines": 0.28676,
    "siemens_star": 0.19946,
    "usaf_bars": 0.05115,
    "gray_ramp": 0.32154,
    "checkerboard": 0.37456,
    "circle_grid": 0.1568,
}
"""Mean light of version 1 at 96 x 128 px under a ramp of weights, which no shifted or mirrored chart shares."""


def chart(name: str, shape: tuple[int, int] = (160, 160)) -> torch.Tensor:
    return Charts(names=(name,)).load(name, shape)[1]


@pytest.mark.parametrize("name", list(CHARTS))
@pytest.mark.parametrize("shape", [(64, 64), (160, 256), (161, 203)])
def test_charts_reach_black_and_white_and_have_three_equal_channels(name, shape):
    target = Charts().load(name, shape)
    assert float(target.min()) < 0.01
    assert float(target.max()) > 0.98
    assert torch.equal(target[0], target[1])
    assert torch.equal(target[0], target[2])


def runs(line: torch.Tensor) -> list[int]:
    """Lengths of the bright runs in a line of black and white."""
    bright = torch.cat([torch.zeros(1), (line > 0.5).float(), torch.zeros(1)])
    steps = bright[1:] - bright[:-1]
    return ((steps < 0).nonzero()[:, 0] - (steps > 0).nonzero()[:, 0]).tolist()


def test_tv_lines_go_from_one_pixel_to_a_thirtieth_in_both_directions():
    image = chart("tv_lines", (300, 300))
    assert {1, 2, 3} <= set(runs(image[20]))
    assert {1, 2, 3} <= {width for column in (20, 150, 280) for width in runs(image[:150, column])}
    assert 10 in runs(image[170])
    assert set(image.flatten().tolist()) == {0.0, 1.0}, "lines of whole pixels need no gray"


def test_tv_lines_stay_inside_on_a_wide_and_on_a_tall_region():
    for image in (chart("tv_lines", (160, 284)), chart("tv_lines", (284, 160))):
        assert float(torch.cat([image[0], image[-1], image[:, 0], image[:, -1]]).max()) == 0.0
        assert 0.3 < float(image.mean()) < 0.5


def test_the_star_has_36_spokes_and_gives_half_the_light_in_its_disc():
    image = chart("siemens_star", (400, 400))
    angles = torch.linspace(0, 2 * torch.pi, 7201)[:-1] + torch.pi / 36
    ring = image[(200 + 150 * angles.sin()).long(), (200 + 150 * angles.cos()).long()]
    assert len(runs(ring)) == 36
    assert torch.allclose(image[199:201, 199:201], torch.full((2, 2), 0.5), atol=0.15)  # gray, not aliased
    assert float(image.sum()) == pytest.approx(0.5 * torch.pi * 190**2, rel=0.005)


@pytest.mark.parametrize("shape", [(200, 300), (300, 200)])
def test_the_star_is_round_on_every_region(shape):
    image = chart("siemens_star", shape)
    rows, columns = (image > 0).any(1).nonzero()[:, 0], (image > 0).any(0).nonzero()[:, 0]
    assert len(rows) == len(columns) == 190
    assert int(rows[0] + rows[-1]) == shape[0] - 1
    assert int(columns[0] + columns[-1]) == shape[1] - 1


def test_usaf_bars_shrink_by_a_sixth_of_an_octave():
    """18 elements, each of six bars of 5 w^2, give 30 w^2 of light; the sum over w tells the widths."""
    side = 340
    image = chart("usaf_bars", (side, side))
    widths = [side / 34 * 2 ** (-element / 6) for element in range(18)]
    assert float(image.sum()) == pytest.approx(sum(30 * width**2 for width in widths), rel=1e-4)
    assert runs(image[15, :200])[:3] == [10, 10, 10]


def test_the_ramp_is_straight_in_linear_light_and_its_patches_in_srgb():
    image = chart("gray_ramp", (120, 240))
    ramp = image[10]
    assert torch.allclose(ramp, torch.linspace(0, 1, 240), atol=1e-6)
    levels = srgb_encode(image[110, 10::20])
    assert torch.allclose(levels, torch.linspace(0, 1, 12), atol=1e-5)


@pytest.mark.parametrize("shape", [(160, 160), (161, 203), (100, 230)])
def test_the_checkerboard_is_balanced_and_antisymmetric_about_its_centre(shape):
    image = chart("checkerboard", shape)
    assert torch.allclose(image + image.flip(1), torch.ones(shape), atol=1e-5)
    assert torch.allclose(image + image.flip(0), torch.ones(shape), atol=1e-5)


def test_discs_are_round_whole_and_one_is_central():
    image = chart("circle_grid", (240, 400))
    step, radius = 30, 0.3 * 30
    central = image[120 - 15 : 120 + 15, 200 - 15 : 200 + 15]
    assert torch.allclose(central, central.T, atol=1e-6)
    assert float(central.sum()) == pytest.approx(torch.pi * radius**2, rel=0.01)
    count = float(image.sum()) / (torch.pi * radius**2)
    assert count == pytest.approx(7 * 13, rel=0.01)
    assert torch.allclose(image[:, : 400 - step][:, 30:], image[:, 60 : 400 - step + 30], atol=1e-6)


@pytest.mark.parametrize("name", [name for name in CHARTS if name != "tv_lines"])
def test_a_larger_chart_averages_to_the_smaller_one(name):
    """Edges are area means. (The finest TV lines are one pixel wide at every size.)"""
    small, large = chart(name, (64, 96)), chart(name, (256, 384))
    averaged = torch.nn.functional.avg_pool2d(large[None, None], 4)[0, 0]
    assert float((small - averaged).abs().mean()) < 0.01


def test_the_drawings_are_those_of_this_version(monkeypatch):
    """A drawing that changes fails here: raise VERSION with it, so that old records are not taken for new ones."""
    assert charts.VERSION == 1
    weights = torch.linspace(0.0, 1.0, 96)[:, None] * torch.linspace(1.0, 2.0, 128)
    found = {name: float((chart(name, (96, 128)) * weights).mean()) for name in CHARTS}
    assert found == pytest.approx(GOLDEN, rel=2e-3)
    before = Charts().digest("tv_lines")
    monkeypatch.setattr(charts, "VERSION", charts.VERSION + 1)
    assert Charts().digest("tv_lines") != before


def test_a_region_too_small_for_a_chart_is_refused():
    with pytest.raises(UserError, match="needs 32 px"):
        Charts().load("tv_lines", (16, 200))
