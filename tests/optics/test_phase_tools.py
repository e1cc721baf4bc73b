import math

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from holobench_eval.optics import AngularSpectrum, blaze, lens, quantise, srgb_decode, srgb_encode, wrap
from holobench_eval.optics.phase import gray_level
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


def test_lens_focuses_a_plane_wave_at_its_focal_length():
    phase = lens((128, 128), 6.4e-6, 517e-9, 0.02)
    focus = AngularSpectrum((128, 128), 6.4e-6, 517e-9, 0.02).forward(torch.polar(torch.ones(128, 128), phase))
    assert float(focus.abs().square().max()) > 500


def disc(size=601):
    axis = torch.linspace(-1, 1, size, dtype=torch.float64)
    y, x = torch.meshgrid(axis, axis, indexing="ij")
    return y, x, (y**2 + x**2) <= 1


def test_zernike_polynomials_are_orthonormal_on_the_disc():
    y, x, inside = disc()
    terms = torch.stack([zernike(index, y, x)[inside] for index in range(1, 16)])
    gram = terms @ terms.T / inside.sum()
    assert torch.allclose(gram, torch.eye(15, dtype=torch.float64), atol=0.02)


def test_noll_order_is_that_of_the_paper():
    assert [noll(j) for j in (1, 2, 3, 4, 5, 6, 7, 8, 11)] == [
        (0, 0), (1, 1), (1, -1), (2, 0), (2, -2), (2, 2), (3, -1), (3, 1), (4, 0),
    ]  # fmt: skip
    with pytest.raises(ValueError, match="starts at 1"):
        noll(0)


def test_wavefront_has_the_rms_it_is_given():
    y, x, inside = disc()
    phase = wavefront({"astigmatism_0": 0.1, "coma_x": 0.2}, y, x)[inside]
    assert float(phase.pow(2).mean().sqrt()) / (2 * math.pi) == pytest.approx(math.hypot(0.1, 0.2), rel=0.02)
    assert set(NAMES.values()) == set(range(1, 12))


@given(st.integers(0, 255))
def test_srgb_round_trip_keeps_every_eight_bit_value(value):
    encoded = torch.tensor([value / 255], dtype=torch.float64)
    assert round(float(srgb_encode(srgb_decode(encoded))) * 255) == value


def test_srgb_gradient_is_finite_at_black():
    linear = torch.zeros(3, dtype=torch.float64, requires_grad=True)
    srgb_encode(linear).sum().backward()
    assert torch.allclose(linear.grad, torch.full((3,), 12.92, dtype=torch.float64))
