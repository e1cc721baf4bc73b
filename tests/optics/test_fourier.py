"""A lens takes the Fourier transform: against a direct sum, numpy.fft and integrals over the pixels."""

import math

import numpy as np
import pytest
import torch

from holobench_eval.optics import FourierLens
from holobench_eval.optics.fourier import fourier_matrix, picture_pitch

SHAPE, PITCH, FOCAL_LENGTH = (9, 14), 8e-6, 0.2
RED, GREEN = 636e-9, 532e-9


def random(*shape):
    return torch.randn(shape, dtype=torch.complex128, generator=torch.Generator().manual_seed(0))


def lens(wavelength=GREEN, shape=SHAPE):
    sample = picture_pitch(shape, PITCH, (GREEN, RED), FOCAL_LENGTH)
    return FourierLens(shape, PITCH, wavelength, FOCAL_LENGTH, sample, dtype=torch.complex128)


def summed(field, wavelength, parts):
    """The diffraction integral over every pixel, by the midpoint rule on ``parts`` lines of it, in metres."""
    sample = GREEN * FOCAL_LENGTH / (14 * PITCH)
    axes = []
    for size in field.shape:
        u = (np.arange(size) - size // 2) * sample
        x = ((np.arange(size * parts) + 0.5) / parts - 0.5 - size // 2) * PITCH
        axes.append(np.exp(-2j * np.pi * u[:, None] * x / (wavelength * FOCAL_LENGTH)))
    fine = np.kron(field.numpy(), np.ones((parts, parts)))
    return axes[0] @ fine @ axes[1].T * (PITCH / parts) ** 2 / (wavelength * FOCAL_LENGTH) * sample / PITCH


@pytest.mark.parametrize("wavelength", [GREEN, RED])
def test_the_picture_is_the_diffraction_integral_over_square_pixels(wavelength):
    field = random(*SHAPE)
    seen, coarse, fine = lens(wavelength).forward(field).numpy(), *(summed(field, wavelength, n) for n in (40, 80))
    integral = fine + (fine - coarse) / 3  # the error of the midpoint rule falls with the square of its step
    assert np.abs(seen - integral).max() < 1e-7 * np.abs(integral).max()


def test_a_square_panel_at_one_wavelength_is_one_fft():
    field = random(12, 12)
    by_fft = np.fft.fftshift(np.fft.fft2(np.fft.ifftshift(field.numpy()), norm="ortho"))
    envelope = np.sinc(np.arange(-6, 6) / 12)
    picture = FourierLens((12, 12), PITCH, GREEN, FOCAL_LENGTH, dtype=torch.complex128).forward(field)
    assert np.allclose(picture.numpy(), by_fft * envelope[:, None] * envelope)


def test_the_adjoint_passes_the_dot_product_test():
    model, u, v = lens(RED), random(2, *SHAPE), random(2, *SHAPE)
    assert torch.allclose((model.forward(u).conj() * v).sum(), (u.conj() * model.adjoint(v)).sum())
    assert torch.equal(model.carried(u, spent=True), model.forward(u))
    assert torch.equal(model.carried(u, back=True, spent=True), model.adjoint(u))


def test_no_light_is_made_and_all_orders_together_have_all_of_it():
    field = random(8)
    step = 1 / 8
    orders = fourier_matrix(8, 4096, step) @ field
    assert float(orders.abs().square().sum()) == pytest.approx(float(field.abs().square().sum()), rel=2e-3)
    for wavelength in (GREEN, RED):
        largest = torch.linalg.matrix_norm(fourier_matrix(8, 8, step * GREEN / wavelength), ord=2)
        assert 0.9 < float(largest) <= 1 + 1e-12


@pytest.mark.parametrize("wavelength", [GREEN, RED])
def test_a_grating_sends_its_light_as_far_as_its_wavelength_says(wavelength):
    shape = (64, 64)
    cycles = 7 / 64 * GREEN / wavelength  # arrives at u = wavelength f cycles / pitch
    ramp = torch.polar(torch.ones(64, dtype=torch.float64), 2 * math.pi * cycles * torch.arange(64.0).double())
    light = lens(wavelength, shape).forward(ramp.expand(shape)).abs()
    assert divmod(int(light.argmax()), 64) == (32, 32 + 7)


def test_sub_samples_of_equal_light_are_a_pixel():
    field = random(10)
    whole, parts = fourier_matrix(10, 16, 0.05), fourier_matrix(10, 16, 0.05, (-1 / 3, 0, 1 / 3), finer=2)
    assert torch.allclose(whole @ field, (parts @ field.repeat(3))[::2])


def test_pixels_of_half_the_pitch_hold_the_intensity_between_them():
    assert picture_pitch((6, 8), 8e-6, (GREEN,), 0.2, 0.5) == 0.5 * picture_pitch((6, 8), 8e-6, (RED, GREEN), 0.2)

    def intensity(size, finer):  # of points, whose picture repeats
        cycles = (torch.arange(finer * size, dtype=torch.float64) / finer - size // 2) / size
        return (fourier_matrix(8, size, 1 / size, finer=finer) @ random(8) / torch.sinc(cycles)).abs().square() * size

    for size, is_held in ((8, False), (16, True)):
        spectrum = torch.fft.fftshift(torch.fft.fft(intensity(size, 1)))
        padded = torch.nn.functional.pad(spectrum, (size // 2, size // 2))
        between = 2 * torch.fft.ifft(torch.fft.ifftshift(padded)).real
        assert torch.allclose(between, intensity(size, 2)) == is_held


def test_a_lens_without_a_focal_length_is_refused():
    with pytest.raises(ValueError, match="positive metres, got 0"):
        FourierLens(SHAPE, PITCH, GREEN, 0.0, 1e-6)
    with pytest.raises(ValueError, match="was made for"):
        lens().forward(random(3, 3))
