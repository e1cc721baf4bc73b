"""How many samples are added, and what for: the estimates that they come from are near what is measured."""

import math

import pytest
import torch

from holobench_eval.optics.angular_spectrum import angular_spectrum_phase
from holobench_eval.optics.kernel.sizes import fast_size
from holobench_eval.optics.padding import DEFAULT_ERROR, IRIS_EDGE, padded_shape, padded_size, spread, tail_error
from holobench_eval.testing.propagation_reference import PITCH, WAVELENGTH


def propagated(lines, distance, samples):
    """Lines of pixels by an angular spectrum of so many samples, double precision, without a band limit."""
    f = torch.fft.fftfreq(samples, PITCH, dtype=torch.float64)
    transfer = torch.polar(torch.ones_like(f), angular_spectrum_phase(f**2, WAVELENGTH, distance))
    return torch.fft.ifft(torch.fft.fft(lines, n=samples) * transfer)[..., : lines.shape[-1]]


@pytest.mark.parametrize(("size", "distance"), [(128, 0.005), (256, 0.02), (512, 0.02)])
def test_the_estimated_error_is_above_the_measured_one_and_at_most_two_and_a_half_times(size, distance):
    lines = torch.randn(16, size, dtype=torch.complex128, generator=torch.Generator().manual_seed(0))
    reach = spread(PITCH, WAVELENGTH, distance)
    right = propagated(lines, distance, 16 * size + 8 * round(reach))
    for room in (1.3, 2.0):
        samples = 2 * (round(size + room * reach) // 2) + 20  # even, as fast sizes are
        measured = float((propagated(lines, distance, samples) - right).norm() / right.norm())
        assert measured < tail_error(size, reach, samples) < 2.5 * measured


@pytest.mark.parametrize("pupil", [None, 0.1, 0.5, 0.9, 0.97, 2.0])
def test_light_spreads_as_far_as_its_highest_frequency_goes(pupil):
    highest = min(1.0, 1.0 if pupil is None else pupil * 1.05) / (2 * PITCH)
    assert spread(PITCH, WAVELENGTH, -0.02, pupil) == pytest.approx(
        0.02 * math.tan(math.asin(WAVELENGTH * highest)) / PITCH
    )
    assert IRIS_EDGE == 0.05


def test_the_spread_of_pixels_below_half_a_wavelength_is_finite():
    assert spread(0.2 * WAVELENGTH, WAVELENGTH, 1e-3) == pytest.approx(7 * 1e-3 / (0.2 * WAVELENGTH), rel=0.01)


@pytest.mark.parametrize(("size", "reach"), [(64, 3.0), (256, 20.5), (256, 100.0), (600, 300.0)])
def test_the_default_is_the_smallest_size_that_keeps_the_error_in_both_axes(size, reach):
    enough = size + math.ceil(reach) + 16
    while tail_error(size, reach, enough) > DEFAULT_ERROR / math.sqrt(2):
        enough += 1
    assert fast_size(enough) <= padded_size(size, reach, None, None) <= fast_size(enough + 1 + enough // 256)


@pytest.mark.parametrize("pupil", [0.96, 1.5])
def test_an_iris_as_wide_as_the_band_pads_as_none_does(pupil):
    assert padded_shape((100, 200), PITCH, WAVELENGTH, 0.01, pupil, None) == padded_shape(
        (100, 200), PITCH, WAVELENGTH, 0.01, None, None
    )


def test_so_many_samples_are_added_as_are_asked_for():
    assert [padded_size(256, 100.0, None, added) for added in (0, 1, 64)] == [256, fast_size(257), fast_size(320)]
    for wrong in (-1, True, 2.5):
        with pytest.raises(ValueError, match="padding must be"):
            padded_size(256, 100.0, None, wrong)
