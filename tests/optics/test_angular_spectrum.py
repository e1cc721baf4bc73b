import math

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from holobench_eval.optics import AngularSpectrum
from holobench_eval.optics.angular_spectrum import band_limit
from holobench_eval.testing.propagation_reference import direct_sum, gaussian_beam

PITCH, WAVELENGTH = 6.4e-6, 517e-9


def four_times_padded(field, distance):
    """An angular spectrum of four times the size in complex128, written out on its own."""
    height, width = field.shape
    rows, columns = 4 * height, 4 * width
    fy = torch.fft.fftfreq(rows, PITCH, dtype=torch.float64)[:, None]
    fx = torch.fft.fftfreq(columns, PITCH, dtype=torch.float64)[None, :]
    axial = torch.sqrt(torch.complex(1 / WAVELENGTH**2 - fy**2 - fx**2, torch.zeros(rows, columns).double()))
    transfer = torch.exp(2j * math.pi * distance * (axial - 1 / WAVELENGTH))
    padded = torch.zeros(rows, columns, dtype=torch.complex128)
    padded[:height, :width] = field
    return torch.fft.ifft2(torch.fft.fft2(padded) * transfer)[:height, :width]


def white(shape, seed=0):
    return torch.randn(shape, generator=torch.Generator().manual_seed(seed), dtype=torch.complex128)


def smooth(shape):
    return gaussian_beam(shape, 0.3 * min(shape) * PITCH)


def relative(found, right):
    return float((found - right).norm() / right.norm())


@pytest.mark.parametrize(("size", "distance"), [(256, 0.01), (512, 0.05), (640, 0.02)])
def test_default_padding_keeps_its_stated_accuracy(size, distance):
    model = AngularSpectrum((size, size), PITCH, WAVELENGTH, distance)
    for field, bound in ((white((size, size)), 1e-2), (smooth((size, size)), 1e-4)):
        found = model.forward(field.to(torch.complex64))
        assert relative(found, four_times_padded(field, distance)) < bound


@pytest.mark.parametrize(("size", "distance"), [(256, 0.02), (512, 0.05)])
def test_reference_padding_keeps_its_stated_accuracy(size, distance):
    model = AngularSpectrum((size, size), PITCH, WAVELENGTH, distance, padding="reference")
    assert model.transfer.dtype == torch.complex128
    for field, bound in ((white((size, size)), 2e-3), (smooth((size, size)), 1e-6)):
        assert relative(model.forward(field), four_times_padded(field, distance)) < bound


def test_reference_is_near_a_far_larger_transform_where_light_spreads_far():
    size, distance = 64, 0.02
    reference = AngularSpectrum((size, size), PITCH, WAVELENGTH, distance, padding="reference")
    larger = AngularSpectrum((size, size), PITCH, WAVELENGTH, distance, padding=20 * size, dtype=torch.complex128)
    assert relative(reference.forward(white((size, size))), larger.forward(white((size, size)))) < 2e-3


@pytest.mark.parametrize("pupil", [0.1, 0.5])
def test_small_iris_keeps_the_stated_accuracy(pupil):
    size, distance = 128, 0.0118
    model = AngularSpectrum((size, size), PITCH, WAVELENGTH, distance, pupil=pupil)
    wide = {"pupil": pupil, "padding": 1400, "dtype": torch.complex128}
    larger = AngularSpectrum((size, size), PITCH, WAVELENGTH, distance, **wide)
    assert relative(model.forward(white((size, size)).to(torch.complex64)), larger.forward(white((size, size)))) < 1e-2


@pytest.mark.parametrize(("shape", "distance"), [((64, 160), 0.02), ((64, 64), 0.05)])
def test_twice_the_panel_is_enough_at_any_distance(shape, distance):
    model = AngularSpectrum(shape, PITCH, WAVELENGTH, distance)
    assert all(padded <= 1.1 * 2 * side for padded, side in zip(model.padded_shape, shape, strict=True))
    larger = AngularSpectrum(shape, PITCH, WAVELENGTH, distance, padding=1500, dtype=torch.complex128)
    assert relative(model.forward(white(shape).to(torch.complex64)), larger.forward(white(shape))) < 5e-3


def test_soft_iris_needs_little_padding():
    size, distance = 256, 0.0237
    model = AngularSpectrum((size, size), PITCH, WAVELENGTH, distance, pupil=0.8)
    reference = AngularSpectrum((size, size), PITCH, WAVELENGTH, distance, pupil=0.8, padding=1500)
    assert max(model.padded_shape) < 1.75 * size
    field = white((size, size))
    assert relative(model.forward(field.to(torch.complex64)), reference.forward(field)) < 5e-3


@settings(max_examples=15, deadline=None)
@given(
    height=st.integers(8, 70),
    width=st.integers(8, 70),
    distance=st.floats(-0.02, 0.02),
    pupil=st.one_of(st.none(), st.floats(0.2, 1.0)),
)
def test_adjoint_is_the_adjoint(height, width, distance, pupil):
    model = AngularSpectrum((height, width), PITCH, WAVELENGTH, distance, pupil=pupil, dtype=torch.complex128)
    u, v = white((height, width), 1), white((height, width), 2)
    left = torch.vdot(model.forward(u).flatten(), v.flatten())
    right = torch.vdot(u.flatten(), model.adjoint(v).flatten())
    assert abs(left - right) < 1e-5 * u.norm() * v.norm()


def test_batches_and_channels_propagate_like_single_fields_with_gradients_of_gradients():
    model = AngularSpectrum((40, 30), PITCH, WAVELENGTH, 0.01)
    batch = torch.randn(2, 3, 40, 30, dtype=torch.complex64)
    each = torch.stack([torch.stack([model.forward(field) for field in image]) for image in batch])
    assert torch.allclose(model.forward(batch), each, atol=1e-5)
    model = AngularSpectrum((6, 5), PITCH, WAVELENGTH, 2e-3, dtype=torch.complex128)
    assert torch.autograd.gradgradcheck(model.forward, white((6, 5), 5).requires_grad_())


def test_zero_distance_is_the_identity_fields_fit_and_transfer_functions_are_cached():
    field = white((32, 48)).to(torch.complex64)
    assert relative(AngularSpectrum((32, 48), PITCH, WAVELENGTH, 0.0).forward(field), field) < 1e-6
    first = AngularSpectrum((50, 50), PITCH, WAVELENGTH, 0.01)
    assert AngularSpectrum((50, 50), PITCH, WAVELENGTH, 0.01).transfer is first.transfer
    with pytest.raises(ValueError, match="made for"):
        AngularSpectrum((16, 16), PITCH, WAVELENGTH, 0.01).forward(torch.zeros(8, 8, dtype=torch.complex64))


@pytest.mark.parametrize("shape", [(24, 24), (60, 200)])  # the kernel is cut off along both axes, or one
@pytest.mark.parametrize("pupil", [None, 0.6])
def test_rows_and_columns_are_treated_alike(shape, pupil):
    field = white(shape)
    model = AngularSpectrum(shape, PITCH, WAVELENGTH, 5e-3, pupil=pupil, dtype=torch.complex128)
    turned = AngularSpectrum(shape[::-1], PITCH, WAVELENGTH, 5e-3, pupil=pupil, dtype=torch.complex128)
    assert turned.padded_shape == model.padded_shape[::-1]
    assert relative(turned.forward(field.T).T, model.forward(field)) < 1e-12


@pytest.mark.parametrize(("size", "padded"), [(100, 130), (100, 200), (100, 500)])
def test_light_of_the_highest_frequency_reaches_half_the_window_or_up_to_the_next_picture(size, padded):
    reach = max(padded / 2, padded - size)
    limit = band_limit(size, padded, PITCH, WAVELENGTH, 0.03)
    assert 0.03 * math.tan(math.asin(WAVELENGTH * limit)) / PITCH == pytest.approx(reach)


@pytest.mark.parametrize(
    "bad",
    [{"pitch": 0.0}, {"wavelength": -1.0}, {"pupil": 0.0}, {"pupil": 2.01}, {"padding": "large"}, {"shape": (0, 4)}],
)
def test_geometry_without_meaning_is_refused(bad):
    good = {"shape": (16, 16), "pitch": PITCH, "wavelength": WAVELENGTH, "distance": 0.01}
    with pytest.raises(ValueError, match=r"must|fraction"):
        AngularSpectrum(**(good | bad))


def test_gaussian_beam_agrees_with_the_direct_rayleigh_sommerfeld_sum():
    shape = (64, 96)
    field = gaussian_beam(shape, 70e-6, tilt=(0.02, -0.03))
    rows, columns = torch.randint(10, 54, (40,)), torch.randint(10, 86, (40,))
    found = AngularSpectrum(shape, PITCH, WAVELENGTH, 6e-3).forward(field.to(torch.complex64))[rows, columns]
    assert relative(found, direct_sum(field, rows, columns, 6e-3)) < 1e-3
