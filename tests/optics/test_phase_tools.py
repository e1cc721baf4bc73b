"""Phases, irises and what propagators share: padding, frequencies, fast passes."""

import math

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from holobench_eval.optics import AngularSpectrum, Fresnel, blaze, lens, quantise, srgb_decode, srgb_encode, wrap
from holobench_eval.optics.angular_spectrum import angular_spectrum_phase
from holobench_eval.optics.convolution import frequencies, iris
from holobench_eval.optics.kernel.elementary import sincos
from holobench_eval.optics.kernel.sizes import fast_size
from holobench_eval.optics.padding import DEFAULT_ERROR, IRIS_EDGE, padded_shape, padded_size, spread, tail_error
from holobench_eval.optics.phase import gray_level, refocus
from holobench_eval.optics.phasor import mean_phasor, phasor, squared_modulus
from holobench_eval.optics.zernike import NAMES, noll, wavefront, zernike
from holobench_eval.testing.propagation_reference import PITCH, WAVELENGTH


@given(st.floats(-1e4, 1e4))
def test_wrapped_phase_is_in_range_and_equivalent(value):
    phase = torch.tensor([value], dtype=torch.float64)
    wrapped = wrap(phase)
    assert 0 <= float(wrapped) < 2 * math.pi
    assert math.cos(value) == pytest.approx(math.cos(float(wrapped)), abs=1e-9)


@given(st.floats(-50, 50), st.integers(1, 10))
def test_quantised_phase_is_within_half_a_level(value, bits):
    phase = torch.tensor([value], dtype=torch.float64)
    error = torch.remainder(quantise(phase, bits) - phase + math.pi, 2 * math.pi) - math.pi
    assert abs(float(error)) <= math.pi / 2**bits + 1e-9


def test_levels_span_two_pi_so_that_first_and_last_differ():
    levels = gray_level(torch.tensor([0.0, 2 * math.pi * 255 / 256, 2 * math.pi * 255.6 / 256]), 8)
    assert levels.tolist() == [0.0, 255.0, 0.0]


def test_blaze_moves_the_spectrum_to_its_carrier_and_stays_within_a_turn():
    ramp = blaze((32, 64), (0.25, -0.125))
    spectrum = torch.fft.fft2(torch.polar(torch.ones(32, 64), ramp)).abs()
    assert int(spectrum.argmax()) == 8 * 64 + (64 - 8)
    ramp = blaze((40, 30), (0.37, -1.2), dtype=torch.float64)
    assert 0 <= float(ramp.min()) < float(ramp.max()) < 2 * math.pi


def test_lens_is_quadratic_in_the_distance_from_the_middle_and_focuses_a_plane_wave():
    phase = lens((5, 8), 6.4e-6, 517e-9, 0.02, dtype=torch.float64)
    y, x = torch.meshgrid(torch.arange(-2, 3) * 6.4e-6, torch.arange(-3.5, 4) * 6.4e-6, indexing="ij")
    assert torch.allclose(phase, -math.pi / (517e-9 * 0.02) * (y.double() ** 2 + x.double() ** 2), rtol=1e-5)
    phase = lens((128, 128), 6.4e-6, 517e-9, 0.02)
    focus = AngularSpectrum((128, 128), 6.4e-6, 517e-9, 0.02).forward(torch.polar(torch.ones(128, 128), phase))
    assert float(focus.abs().square().max()) > 500


def test_refocus_is_the_paraxial_phase_of_the_way_that_is_left_in_each_meridian():
    fy, fx = torch.randn(2, 4, 5, generator=torch.Generator().manual_seed(0), dtype=torch.float64) * 1e4
    f, focus = torch.stack([fy, fx], -1), torch.tensor([[0.2, 0.03], [0.03, -0.1]], dtype=torch.float64)
    expected = -math.pi * 517e-9 * 0.02 * torch.einsum("...i,ij,...j->...", f, focus, f)
    assert torch.allclose(refocus((0.2, -0.1, 0.03), fy, fx, 517e-9, 0.02), expected, rtol=1e-9)


def disc(size=601):
    axis = torch.linspace(-1, 1, size, dtype=torch.float64)
    y, x = torch.meshgrid(axis, axis, indexing="ij")
    return y, x, (y**2 + x**2) <= 1


def test_zernike_polynomials_are_orthonormal_on_the_disc():
    y, x, inside = disc()
    terms = torch.stack([zernike(index, y, x)[inside] for index in range(1, 16)])
    gram = terms @ terms.T / inside.sum()
    assert torch.allclose(gram, torch.eye(15, dtype=torch.float64), atol=0.02)


def test_low_zernike_polynomials_are_those_of_their_names():
    y, x, _ = disc(21)
    squared = x**2 + y**2
    named = {
        "piston": torch.ones_like(x),
        "tilt_x": 2 * x,
        "tilt_y": 2 * y,
        "defocus": math.sqrt(3) * (2 * squared - 1),
        "astigmatism_45": 2 * math.sqrt(6) * x * y,
        "astigmatism_0": math.sqrt(6) * (x**2 - y**2),
        "coma_y": math.sqrt(8) * (3 * squared - 2) * y,
        "coma_x": math.sqrt(8) * (3 * squared - 2) * x,
        "trefoil_y": math.sqrt(8) * (3 * x**2 - y**2) * y,
        "trefoil_x": math.sqrt(8) * (x**2 - 3 * y**2) * x,
        "spherical": math.sqrt(5) * (6 * squared**2 - 6 * squared + 1),
    }
    for name, expected in named.items():
        assert torch.allclose(wavefront({name: 1 / (2 * math.pi)}, y, x), expected, atol=1e-9), name
    assert [NAMES[name] for name in named] == list(range(1, 12)) == sorted(NAMES.values())
    with pytest.raises(ValueError, match="starts at 1"):
        noll(0)


@given(st.integers(0, 255))
def test_srgb_round_trip_keeps_every_eight_bit_value(value):
    encoded = torch.tensor([value / 255], dtype=torch.float64)
    assert round(float(srgb_encode(srgb_decode(encoded))) * 255) == value


def test_srgb_gradient_is_finite_at_black():
    linear = torch.zeros(3, dtype=torch.float64, requires_grad=True)
    srgb_encode(linear).sum().backward()
    assert torch.allclose(linear.grad, torch.full((3,), 12.92, dtype=torch.float64))


@pytest.mark.parametrize("pupil", [0.3, 0.8])
def test_an_iris_is_open_within_its_radius_and_closed_beyond_it_with_a_soft_edge(pupil):
    radius = torch.tensor([0.0, 0.5, 0.949, 0.975, 1.0, 1.025, 1.051, 2.0], dtype=torch.float64)
    for angle in (0.0, 1.0, math.pi / 2):
        f = radius * pupil / (2 * PITCH)
        passed = iris(f * math.sin(angle), f * math.cos(angle), PITCH, pupil)
        high, low = (2 + math.sqrt(2)) / 4, (2 - math.sqrt(2)) / 4
        assert passed.tolist() == pytest.approx([1, 1, 1, high, 0.5, low, 0, 0], abs=1e-6)


def test_without_an_iris_all_passes_and_frequencies_reach_half_a_cycle_a_pixel():
    fy, fx = frequencies((4, 6), PITCH)
    assert torch.equal(iris(fy, fx, PITCH, None), torch.ones(4, 6, dtype=torch.float64))
    fy, fx = frequencies((4, 5), PITCH)
    assert (fy.shape, fx.shape) == ((4, 1), (1, 5))
    assert (fy.ravel() * PITCH).tolist() == pytest.approx([0, 0.25, -0.5, -0.25])
    assert (fx.ravel() * PITCH).tolist() == pytest.approx([0, 0.2, 0.4, -0.4, -0.2])


def test_a_field_is_propagated_in_the_precision_of_the_model():
    field = torch.ones(8, 8)
    for dtype in (torch.complex64, torch.complex128):
        assert Fresnel((8, 8), PITCH, 517e-9, 1e-3, dtype=dtype).forward(field).dtype == dtype


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
    far = 0.02 * math.tan(math.asin(WAVELENGTH * highest)) / PITCH
    assert spread(PITCH, WAVELENGTH, -0.02, pupil) == pytest.approx(far)
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
    shapes = {padded_shape((100, 200), PITCH, WAVELENGTH, 0.01, iris, None) for iris in (pupil, None)}
    assert len(shapes) == 1


def test_so_many_samples_are_added_as_are_asked_for():
    assert [padded_size(256, 100.0, None, added) for added in (0, 1, 64)] == [256, fast_size(257), fast_size(320)]
    for wrong in (-1, True, 2.5):
        with pytest.raises(ValueError, match="padding must be"):
            padded_size(256, 100.0, None, wrong)


AMPLITUDE = torch.rand(5, 6, dtype=torch.float64, generator=torch.Generator().manual_seed(0))


def test_phasor_is_a_polar_field_with_its_gradient():
    phase = (20 * torch.rand(3, 5, 6, dtype=torch.float64) - 10).requires_grad_()
    assert torch.allclose(phasor(AMPLITUDE, phase), torch.polar(AMPLITUDE.expand(3, 5, 6), phase))
    assert torch.autograd.gradcheck(lambda angle: phasor(AMPLITUDE, angle), phase)


def test_squared_modulus_is_that_with_its_gradient():
    field = torch.randn(5, 6, dtype=torch.complex128, requires_grad=True)
    assert torch.allclose(squared_modulus(field), field.abs().square())
    assert torch.autograd.gradcheck(squared_modulus, field)


def test_a_mean_of_phasors_is_that_with_its_gradient():
    phase = (20 * torch.rand(3, 5, 6, dtype=torch.float64) - 10).requires_grad_()
    for dim in (0, 1, -1):
        assert torch.allclose(mean_phasor(phase, dim), torch.polar(torch.ones_like(phase), phase).mean(dim))
        assert torch.autograd.gradcheck(mean_phasor, (phase, dim))


def test_sine_and_cosine_have_the_accuracy_that_they_state():
    angles = np.linspace(-60, 60, 200_001, dtype=np.float32)[::40]
    found = np.array([sincos(angle) for angle in angles])
    exact = np.stack([np.sin(angles.astype(float)), np.cos(angles.astype(float))], 1)
    assert np.abs(found - exact).max() < 1.5e-7
