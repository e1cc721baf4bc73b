"""What makes an image wrong: it is compared with the images that well-known mistakes give."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import product

import torch
from torch import Tensor

from .propagation_reference import INSETS, Grid, Physics, Setting, Transform, difference, propagated, sampled_kernel

EXPLAINED = 0.3
"""A mistake is the cause if it leaves at most this share of the difference."""

EXPLAINED_WITH_REST, REST = 0.75, 0.01
"""The share if a second mistake makes the rest, and the smallest rest, relative to the field, that it is named for."""

CERTAIN = 0.01
"""No other mistake is tried after one that leaves at most this share."""

UNKNOWN = "none of the mistakes known to the kit gives this image"
MODELS: dict[Physics, str] = {
    "exact": "an exact model, where a paraxial one is claimed",
    "paraxial": "a paraxial (Fresnel) model",
}
GRIDS: dict[Grid, str] = {
    "fftfreq": "",
    **dict.fromkeys(INSETS, "frequencies half a sample off (linspace for fftfreq)"),
    "one off": "frequencies one sample off (fftshift for ifftshift)",
}
PADDINGS = {
    1: "circular, no zero padding: what leaves on one side comes back on the other",
    2: "padding to twice the size is too little without a band limit",
    3: "padding to three times the size is too little without a band limit",
}


def cause(field: Tensor, image: Tensor, setting: Setting, physics: Physics) -> str:
    """The likeliest reason, in one line, why ``image`` is not ``field`` propagated; ``(H, W)`` complex128, not zero."""
    right = propagated(field, setting, physics)
    wrong = difference(image, right, field)
    factor = float(torch.vdot(right.flatten(), image.flatten()).abs() / right.norm() ** 2)
    if factor > 0 and difference(image / factor, right) < EXPLAINED * min(1, abs(factor - 1)):
        return f"right but for a factor of {factor:.3g} in amplitude{_normalisation(factor, setting)}"
    words, left = _nearest(field, image, setting, physics, wrong)
    rest = _carrier(left, setting)
    if left < EXPLAINED * wrong or (rest and left < EXPLAINED_WITH_REST * wrong):
        return f"{words}; {rest}" if rest else words
    return _displaced(image, right, setting) or _carrier(wrong, setting) or _low_pass(image, right) or UNKNOWN


def _nearest(field: Tensor, image: Tensor, setting: Setting, physics: Physics, wrong: float) -> tuple[str, float]:
    """The mistake whose image is nearest, and how far that is, relative to the field; the simplest if several are."""
    nearest = "", math.inf
    for words, other in _mistaken(field, setting, physics):
        left = difference(image, other, field)
        if left < nearest[1] / 2:
            nearest = words, left
        if left < CERTAIN * wrong:
            break
    return nearest


def _mistaken(field: Tensor, setting: Setting, physics: Physics) -> Iterator[tuple[str, Tensor]]:
    """The images of mistakes, simple ones first, each with its name."""
    turned = torch.roll(propagated(field, setting, physics).flip(0, 1), (1, 1), (0, 1))
    yield "turned by 180 degrees: a second fft2 in the place of ifft2", turned
    sampled = sampled_kernel(field, setting)
    yield "a kernel steeper than the pixels sample: cut it there, and claim a smaller band", sampled
    models: tuple[Physics, Physics] = ("exact", "paraxial") if physics == "exact" else ("paraxial", "exact")
    for sign, model, samples in product((1, -1), models, (4, 3, 2, 1)):
        given = replace(setting, distance=sign * setting.distance)
        whole = [MODELS[model]] if model != physics else []
        whole += ["wrong sign of the distance or phase"] if sign < 0 else []
        for grid, limited in product(GRIDS, (False, True)):
            words = [*whole, *_grid_and_padding(samples, grid, limited)]
            if words:
                yield ", ".join(words), propagated(field, given, model, Transform(samples, grid, limited))


def _grid_and_padding(samples: int, grid: Grid, limited: bool) -> list[str]:
    if grid != "fftfreq":
        return [GRIDS[grid], f"padded {samples}x"]
    if limited and samples > 1:
        return ["the hard edge of a band limit"]
    return [PADDINGS[samples]] if samples in PADDINGS else []


def displacement(dy: float, dx: float, setting: Setting) -> str:
    """A displacement [px], and where it may come from."""
    return f"({dy:z.2f}, {dx:z.2f}) px aside: {_frequency_offset(max(dy, dx, key=abs), setting)}"


def _frequency_offset(pixels: float, setting: Setting) -> str:
    """What displaces light by so many pixels along one axis, as far as it can be told."""
    offset = abs(pixels) / setting.travel(1.0)  # [1/m]; at low frequencies light goes aside in proportion to them
    for padding, samples in product((1, 2, 3, 4), (0.5, 1.0)):
        if math.isclose(offset * padding * setting.shape[0] * setting.pitch, samples, rel_tol=0.06):
            known = GRIDS["ends" if samples < 1 else "one off"]
            return f"{known}, padded {padding}x"
    if min(abs(pixels - whole) for whole in (-1, -0.5, 0.5, 1)) < 0.02:
        return "a wrong pair of shifts, or the padding cropped at another place"
    return "a wrong frequency grid, or padding cropped at another place"


def _carrier(error: float, setting: Setting) -> str:
    """Whether an error is as large as that of 2 pi z / lambda in single precision; empty if not."""
    phase = math.tau * abs(setting.distance) / setting.wavelength
    step = 2.0 ** (math.floor(math.log2(phase)) - 23)
    if error < REST or not 0.3 < error / (step / math.sqrt(12)) < 6:
        return ""
    return f"exp(ikz) formed in float32 (steps of {step:.2g} rad)"


def _normalisation(factor: float, setting: Setting) -> str:
    pixels = math.prod(setting.shape)
    known = {"H W": pixels, "1 / (H W)": 1 / pixels, "sqrt(H W)": pixels**0.5, "1 / sqrt(H W)": pixels**-0.5}
    known["pitch^2"], known["1 / pitch^2"] = setting.pitch**2, setting.pitch**-2
    for name, value in known.items():
        for padding in (1, 4, 16):
            if math.isclose(factor, value * padding, rel_tol=0.02) or math.isclose(
                factor, value / padding, rel_tol=0.02
            ):
                return f", {name}: normalisation of the transform or of the kernel"
    return ": normalisation of the transform or of the kernel"


def _displaced(image: Tensor, right: Tensor, setting: Setting) -> str:
    """The displacement of the image, if that is most of what is wrong."""
    spectra = torch.fft.fft2(image), torch.fft.fft2(right)
    correlation = spectra[0] * spectra[1].conj()
    peak = int(torch.fft.ifft2(correlation).abs().argmax())
    fy, fx = (torch.fft.fftfreq(size, dtype=torch.float64) for size in right.shape)
    height, width = right.shape
    near = torch.arange(-1, 1.0001, 0.02, dtype=torch.float64)
    rows = (peak // width + height // 2) % height - height // 2 + near
    columns = (peak % width + width // 2) % width - width // 2 + near
    to_rows = torch.exp(2j * math.pi * rows[:, None] * fy)
    to_columns = torch.exp(2j * math.pi * fx[:, None] * columns)
    best = int((to_rows @ correlation @ to_columns).abs().argmax())
    dy, dx = float(rows[best // len(near)]), float(columns[best % len(near)])
    shift = torch.exp(-2j * math.pi * (fy[:, None] * dy + fx * dx))
    left = difference(image, torch.fft.ifft2(spectra[1] * shift)) / difference(image, right)
    return displacement(dy, dx, setting) if math.hypot(dy, dx) > 0.05 and left < 0.5 else ""


def _low_pass(image: Tensor, right: Tensor) -> str:
    """The share of the spectrum that is missing, if the rest is as it should be."""
    seen, wanted = (torch.fft.fftshift(torch.fft.fft2(each)) for each in (image, right))
    powers = [torch.nn.functional.avg_pool2d(each.abs().square()[None], 5, 1, 2)[0] for each in (seen, wanted)]
    present = powers[1] > 0.1 * powers[1].mean()
    passed = present & (powers[0] > 0.3 * powers[1])
    missing = 1 - float(passed.sum() / present.sum())
    if missing < 0.05 or not passed.any() or difference(seen[passed], wanted[passed]) > EXPLAINED:
        return ""
    return f"a low pass: {missing:.0%} of the spectrum is missing"
