from itertools import pairwise

import numpy as np
import pytest
import torch
from scipy import stats

from holobench_eval.core.errors import UserError
from holobench_eval.core.seeds import generator
from holobench_eval.datasets import charts
from holobench_eval.datasets.charts import CHARTS, Charts
from holobench_eval.datasets.dead_leaves import DeadLeaves, radii
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


def test_tv_lines_go_from_one_pixel_to_a_thirtieth_and_stay_inside_any_region():
    image = chart("tv_lines", (300, 300))
    assert {1, 2, 3} <= set(runs(image[20]))
    assert {1, 2, 3} <= {width for column in (20, 150, 280) for width in runs(image[:150, column])}
    assert 10 in runs(image[170])
    assert set(image.flatten().tolist()) == {0.0, 1.0}, "lines of whole pixels need no gray"
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


def test_the_drawings_are_those_of_this_version_and_a_region_too_small_is_refused(monkeypatch):
    """A drawing that changes fails here: raise VERSION with it, so that old records are not taken for new ones."""
    assert charts.VERSION == 1
    weights = torch.linspace(0.0, 1.0, 96)[:, None] * torch.linspace(1.0, 2.0, 128)
    found = {name: float((chart(name, (96, 128)) * weights).mean()) for name in CHARTS}
    assert found == pytest.approx(GOLDEN, rel=2e-3)
    before = Charts().digest("tv_lines")
    monkeypatch.setattr(charts, "VERSION", charts.VERSION + 1)
    assert Charts().digest("tv_lines") != before
    with pytest.raises(UserError, match="needs 32 px"):
        Charts().load("tv_lines", (16, 200))


def test_radii_follow_a_power_law_with_exponent_three():
    """The integral of r^-3 from a to r, over that from a to b, is what a Kolmogorov-Smirnov test compares with."""
    low, high = 2.0, 60.0
    drawn = radii(20_000, low, high, generator("radii")).numpy()

    def expected(exponent: float):
        power = 1 - exponent
        return lambda r: (low**power - r**power) / (low**power - high**power)

    assert drawn.min() >= low
    assert drawn.max() <= high
    assert stats.kstest(drawn, expected(3.0)).pvalue > 0.01
    assert stats.kstest(drawn, expected(2.8)).pvalue < 1e-3
    assert stats.kstest(drawn, expected(3.2)).pvalue < 1e-3


def test_an_image_depends_on_its_seed_colours_and_number_alone():
    one, other = DeadLeaves(), DeadLeaves(seed=1)
    assert not torch.equal(one.load("leaves-000", (32, 32)), other.load("leaves-000", (32, 32)))
    assert one.digest("leaves-000") != other.digest("leaves-000")
    many = DeadLeaves(count=50)
    before = many.load("leaves-030", (32, 32))
    torch.manual_seed(7)
    assert torch.equal(many.load("leaves-002", (32, 32)), DeadLeaves(count=3).load("leaves-002", (32, 32)))
    assert not torch.equal(many.load("leaves-002", (32, 32)), before)
    assert many.load("leaves-002", (3, 50)).shape == (3, 3, 50)
    digests = [DeadLeaves(colours=colours).digest("leaves-000") for colours in ("uniform", "natural")]
    assert digests[0] != digests[1]
    assert digests[0] == "8df7378f2cb38108140d7a458c4ee9d2c17c8515fc4bd9068803514731a9d72c"  # as before there were two


def test_leaves_are_flat_with_sharp_edges():
    """Most neighbours are equal (within a leaf) and some differ much (across an edge)."""
    image = DeadLeaves().load("leaves-000", (192, 192))
    steps = (image[:, :, 1:] - image[:, :, :-1]).abs().amax(0)
    assert float((steps < 1e-6).float().mean()) > 0.4
    assert float((steps > 0.2).float().mean()) > 0.1
    assert float((image.amax(0) - image.amin(0)).mean()) > 0.03  # and coloured


def test_the_power_spectrum_falls_as_in_photographs():
    """Log-log slope of power over frequency; photographs lie between -1.4 and -3.4."""
    frequency = np.hypot(*np.meshgrid(np.fft.fftfreq(192), np.fft.fftfreq(192)))
    window = np.hanning(192)
    edges = np.geomspace(0.03, 0.4, 9)
    power = np.zeros(8)
    for index in range(4):
        image = srgb_encode(DeadLeaves().load(f"leaves-{index:03d}", (192, 192))).mean(0).numpy()
        spectrum = np.abs(np.fft.fft2((image - image.mean()) * np.outer(window, window))) ** 2
        power += [spectrum[(frequency >= low) & (frequency < high)].mean() for low, high in pairwise(edges)]
    slope = np.polyfit(np.log(edges[:-1]), np.log(power), 1)[0]
    assert -3.0 < slope < -1.8


def test_the_border_looks_like_the_middle():
    """Without leaves that lie partly outside, the border would show another mean or spread than the middle."""
    images = srgb_encode(torch.stack([DeadLeaves().load(f"leaves-{index:03d}", (64, 64)) for index in range(24)]))
    border = torch.cat([images[..., :4].flatten(), images[..., -4:].flatten()])
    middle = images[..., 28:36].flatten()
    assert float(border.mean()) == pytest.approx(float(middle.mean()), abs=0.06)
    assert float(border.std()) == pytest.approx(float(middle.std()), abs=0.04)


def test_natural_colours_have_the_brightness_of_photographs():
    """Over pixels and images: the mean and the deviation of ImageNet, but for what is clipped."""
    dataset = DeadLeaves(count=12, colours="natural")
    pixels = torch.stack([srgb_encode(dataset.load(item, (96, 96))) for item in dataset.items()]).transpose(0, 1)
    assert torch.allclose(pixels.mean((1, 2, 3)), torch.tensor([0.485, 0.456, 0.406]), atol=0.04)
    assert torch.allclose(pixels.std((1, 2, 3)), torch.tensor(0.22), atol=0.03)
