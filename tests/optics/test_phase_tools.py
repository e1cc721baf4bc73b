import math

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from holobench_eval.optics import AngularSpectrum, blaze, lens, quantise, srgb_decode, srgb_encode, wrap
from holobench_eval.optics.phase import gray_level, refocus
from holobench_eval.optics.zernike import NAMES, noll, wavefront, zernike


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


def test_blaze_moves_the_spectrum_to_its_carrier():
    ramp = blaze((32, 64), (0.25, -0.125))
    spectrum = torch.fft.fft2(torch.polar(torch.ones(32, 64), ramp)).abs()
    assert int(spectrum.argmax()) == 8 * 64 + (64 - 8)


def test_blaze_stays_within_a_turn():
    ramp = blaze((40, 30), (0.37, -1.2), dtype=torch.float64)
    assert 0 <= float(ramp.min()) < float(ramp.max()) < 2 * math.pi


def test_lens_is_quadratic_in_the_distance_from_the_middle_of_the_panel():
    phase = lens((5, 8), 6.4e-6, 517e-9, 0.02, dtype=torch.float64)
    y, x = torch.meshgrid(torch.arange(-2, 3) * 6.4e-6, torch.arange(-3.5, 4) * 6.4e-6, indexing="ij")
    assert torch.allclose(phase, -math.pi / (517e-9 * 0.02) * (y.double() ** 2 + x.double() ** 2), rtol=1e-5)


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


def test_lens_focuses_a_plane_wave_at_its_focal_length():
    phase = lens((128, 128), 6.4e-6, 517e-9, 0.02)
    focus = AngularSpectrum((128, 128), 6.4e-6, 517e-9, 0.02).forward(torch.polar(torch.ones(128, 128), phase))
    assert float(focus.abs().square().max()) > 500
