"""Generated training images."""

from itertools import pairwise

import numpy as np
import pytest
import torch
from scipy import stats

from holobench_eval.core.seeds import generator
from holobench_eval.datasets.dead_leaves import DeadLeaves, radii
from holobench_eval.optics import srgb_encode


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


def test_another_seed_gives_other_images_and_digests():
    one, other = DeadLeaves(), DeadLeaves(seed=1)
    assert not torch.equal(one.load("leaves-000", (32, 32)), other.load("leaves-000", (32, 32)))
    assert one.digest("leaves-000") != other.digest("leaves-000")


def test_an_image_does_not_depend_on_how_many_there_are_nor_on_what_was_drawn_before():
    many = DeadLeaves(count=50)
    before = many.load("leaves-030", (32, 32))
    torch.manual_seed(7)
    assert torch.equal(many.load("leaves-002", (32, 32)), DeadLeaves(count=3).load("leaves-002", (32, 32)))
    assert not torch.equal(many.load("leaves-002", (32, 32)), before)
    assert many.load("leaves-002", (3, 50)).shape == (3, 3, 50)


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


def test_colours_are_part_of_an_images_identity():
    digests = [DeadLeaves(colours=colours).digest("leaves-000") for colours in ("uniform", "natural")]
    assert digests[0] != digests[1]
    assert digests[0] == "8df7378f2cb38108140d7a458c4ee9d2c17c8515fc4bd9068803514731a9d72c"  # as before there were two
