"""A mistake is named where its twin gives the same image, and nothing is named where no twin does."""

import math

import pytest
import torch

from holobench_eval.testing.propagation_causes import UNKNOWN, cause
from holobench_eval.testing.propagation_reference import Setting, gaussian_beam, white_field

LONG = Setting((64, 64), 0.2), gaussian_beam((64, 64), 100e-6, tilt=(0.004, 0.008))
WHITE = Setting((48, 65), 2e-3, 3.74e-6), white_field((48, 65), 0.9)
TAU = 2 * math.pi


def image(kernel, setting, field, padding=2, grid=torch.fft.fftfreq):
    """An angular spectrum as a user writes it. kernel: of frequencies, wavelength and distance."""
    padded = [padding * size for size in setting.shape]
    fy, fx = (grid(size, setting.pitch) for size in padded)
    transfer = kernel(fy[:, None], fx, setting.wavelength, setting.distance)
    spectrum = torch.fft.fft2(field, s=padded) * transfer
    return torch.fft.ifft2(spectrum)[: setting.shape[0], : setting.shape[1]]


def doubled(size, pitch):
    return torch.fft.fftfreq(size, pitch, dtype=torch.float64)


def root(y, x, w):
    return torch.sqrt(1 / w**2 - y**2 - x**2)


def exact(y, x, w, z):
    return torch.exp(1j * TAU * z * (root(y, x, w) - 1 / w))


SINGLE_PRECISION = [
    lambda y, x, w, z: torch.exp(1j * TAU * z * root(y, x, w)),
    lambda y, x, w, z: torch.exp(1j * (TAU * root(y, x, w)) * z),
    lambda y, x, w, z: torch.exp(1j * TAU / w * z * torch.sqrt(1 - (w * x) ** 2 - (w * y) ** 2)),
    lambda y, x, w, z: torch.exp(1j * z * torch.sqrt((TAU / w) ** 2 - (TAU * x) ** 2 - (TAU * y) ** 2)),
    lambda y, x, w, z: torch.exp(1j * (TAU / w * z * torch.sqrt(1 - w**2 * (y**2 + x**2).double())).float()),
]


@pytest.mark.parametrize(
    ("kernel", "padding"), [*((kernel, 2) for kernel in SINGLE_PRECISION), (SINGLE_PRECISION[0], 4)]
)
def test_single_precision_is_named_where_the_same_rounding_gives_the_same_image(kernel, padding):
    setting, field = LONG
    assert "formed in float32" in cause(field, image(kernel, setting, field, padding), setting, "exact")


def test_a_paraxial_phase_in_single_precision_is_named():
    setting, field = LONG
    kernel = lambda y, x, w, z: torch.exp(1j * (TAU / w * z - math.pi * w * z * (x**2 + y**2)))  # noqa: E731
    assert "formed in float32" in cause(field, image(kernel, setting, field), setting, "paraxial")


OUTSIDE = {
    "exp2 for exp": lambda s, f: image(lambda y, x, w, z: torch.exp2(1j * TAU * z * root(y, x, w)), s, f, grid=doubled),
    "pitch 1 % off": lambda s, f: image(lambda y, x, w, z: exact(y / 1.01, x / 1.01, w, z), s, f, 4, doubled),
    "wavelength 1 % off": lambda s, f: image(lambda y, x, w, z: exact(y, x, 1.01 * w, z), s, f, 4, doubled),
    "distance 1 % off": lambda s, f: image(lambda y, x, w, z: exact(y, x, w, 1.01 * z), s, f, 4, doubled),
    "conjugated input": lambda s, f: image(exact, s, f.conj(), 4, doubled),
    "transposed pitch": lambda s, f: image(lambda y, x, w, z: exact(y, 1.2 * x, w, z), s, f, 4, doubled),
    "noise": lambda s, f: (
        image(exact, s, f, 4, doubled) + 0.05 * torch.randn(f.shape, generator=torch.Generator().manual_seed(0))
    ),
    "an apodisation": lambda s, f: image(exact, s, f, 4, doubled) * torch.linspace(0.5, 1, f.shape[1]),
    "no imaginary part": lambda s, f: image(exact, s, f, 4, doubled).real + 0j,
    "weak and unlike": lambda s, f: 1e-3 * f.flip(0) ** 2,
}


@pytest.mark.parametrize("fault", OUTSIDE)
def test_a_mistake_that_has_no_twin_gets_no_cause(fault):
    setting, field = WHITE if fault.endswith("off") else LONG
    assert cause(field, OUTSIDE[fault](setting, field), setting, "exact") == UNKNOWN


FAR = Setting((48, 65), 12e-3, 3.74e-6), white_field((48, 65), 0.9)


def limited(y, x, w, z, window=(2 * 48 * 3.74e-6, 2 * 65 * 3.74e-6)):
    """The band limit of Matsushima & Shimobaba 2009."""
    limits = [1 / (w * math.hypot(1, 2 * z / side)) for side in window]
    return exact(y, x, w, z) * (y.abs() <= limits[0]) * (x.abs() <= limits[1])


def impulse_response(setting, field):
    """The first Rayleigh-Sommerfeld integral as a convolution with its sampled kernel."""
    y, x = (setting.pitch * torch.arange(1 - size, size, dtype=torch.float64) for size in setting.shape)
    rho = torch.sqrt(y[:, None] ** 2 + x**2 + setting.distance**2)
    k = TAU / setting.wavelength
    kernel = setting.distance / (TAU * rho**2) * (1 / rho - 1j * k) * torch.exp(1j * k * rho) * setting.pitch**2
    padded = [3 * size - 2 for size in setting.shape]
    whole = torch.fft.ifft2(torch.fft.fft2(field, s=padded) * torch.fft.fft2(kernel, s=padded))
    return whole[tuple(slice(size - 1, 2 * size - 1) for size in setting.shape)]


def disc(y, x, w, z):
    return exact(y, x, w, z) * (torch.hypot(y, x) < 0.3 / 3.74e-6)


NAMED = {
    "padding to three times the size is too little": (FAR, lambda s, f: image(exact, s, f, 3, doubled)),
    "padding to twice the size is too little": (FAR, lambda s, f: image(exact, s, f, 2, doubled)),
    "the hard edge of a band limit": (FAR, lambda s, f: image(limited, s, f, 2, doubled)),
    "a kernel steeper than the pixels sample": (WHITE, impulse_response),
    "the band ends at 0.60 of that of the pixels in any": (WHITE, lambda s, f: image(disc, s, f, 4, doubled)),
}


@pytest.mark.parametrize("words", NAMED)
def test_a_mistake_that_has_a_twin_is_named_whoever_makes_it(words):
    (setting, field), wrong = NAMED[words]
    assert words in cause(field, wrong(setting, field), setting, "exact")
