"""What makes an image wrong: a mistake is named where its twin, with the mistake built in, gives the same image."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import product

import torch
from torch import Tensor

from .propagation_reference import (
    INSETS,
    ROUNDED,
    TAU,
    Grid,
    Physics,
    Radius,
    Setting,
    Transform,
    difference,
    propagated,
    sampled_kernel,
)

EXPLAINED = 0.1
"""A mistake is the cause if its twin leaves at most this share of the difference, and of the image."""

CERTAIN = 0.01
"""No other mistake is tried after one that leaves at most this share."""

UNKNOWN = "none of the mistakes known to the kit gives this image"
SINGLE = "exp(ikz) formed in float32"
MODELS: dict[Physics, str] = {
    "exact": "an exact model, where a paraxial one is claimed",
    "paraxial": "a paraxial (Fresnel) model",
}
GRIDS: dict[Grid, str] = {
    "fftfreq": "",
    **dict.fromkeys(INSETS, "frequencies half a sample off (linspace for fftfreq)"),
    "one off": "frequencies one sample off (fftshift for ifftshift)",
}
RADII: dict[str, Radius] = {
    " on each axis": lambda fy, fx: torch.maximum(fy.abs(), fx.abs()),
    " in any direction": torch.hypot,
}
PADDINGS = {
    1: "circular, no zero padding: what leaves on one side comes back on the other",
    2: "padding to twice the size is too little without a band limit",
    3: "padding to three times the size is too little without a band limit",
}


def cause(field: Tensor, image: Tensor, setting: Setting, physics: Physics) -> str:
    """Which mistake gives ``image`` in the place of ``field`` propagated, in one line, or that no known one does.

    ``(H, W)`` complex128, not zero. Of twins that are about as near to the image, the simplest is named.
    """
    right = propagated(field, setting, physics)
    wrong = difference(image, right, field)
    nearest, least = UNKNOWN, EXPLAINED * wrong
    for words, twin in _twins(field, image, right, setting, physics):
        left = difference(image, twin, min(field, image, key=torch.norm))
        if left < least / (1 if nearest == UNKNOWN else 2):
            nearest, least = words, left
        if left < CERTAIN * wrong:
            break
    return nearest


def _twins(
    field: Tensor, image: Tensor, right: Tensor, setting: Setting, physics: Physics
) -> Iterator[tuple[str, Tensor]]:
    """The images of mistakes, simple ones first, each with its name; a figure is the one that fits best."""
    factor = float(torch.vdot(right.flatten(), image.flatten()).abs() / right.norm() ** 2)
    yield f"right but for a factor of {factor:.3g} in amplitude", factor * right
    turned = torch.roll(right.flip(0, 1), (1, 1), (0, 1))
    yield "turned by 180 degrees: a second fft2 in the place of ifft2", turned
    yield (
        "a kernel steeper than the pixels sample: cut it there, and claim a smaller band",
        sampled_kernel(field, setting),
    )
    models: tuple[Physics, Physics] = ("exact", "paraxial") if physics == "exact" else ("paraxial", "exact")
    for sign, model, samples in product((1, -1), models, (4, 3, 2, 1)):
        given = replace(setting, distance=sign * setting.distance)
        whole = [MODELS[model]] if model != physics else []
        whole += ["wrong sign of the distance or phase"] if sign < 0 else []
        for grid, limited in product(GRIDS, (False, True)):
            words = [*whole, *_grid_and_padding(samples, grid, limited)]
            if words:
                yield ", ".join(words), propagated(field, given, model, Transform(samples, grid, limited))
    yield _displaced(image, right)
    yield from _low_passes(field, image, right, setting, physics)
    yield from _in_single_precision(field, setting, physics, difference(image, right, field))


def _grid_and_padding(samples: int, grid: Grid, limited: bool) -> list[str]:
    if grid != "fftfreq":
        return [GRIDS[grid], f"padded {samples}x"]
    if limited and samples > 1:
        return ["the hard edge of a band limit"]
    return [PADDINGS[samples]] if samples in PADDINGS else []


def _in_single_precision(
    field: Tensor, setting: Setting, physics: Physics, wrong: float
) -> Iterator[tuple[str, Tensor]]:
    """Twins that round 2 pi z / lambda, if rounding makes errors of this size."""
    step = 2.0 ** (math.floor(math.log2(TAU * abs(setting.distance) / setting.wavelength)) - 23)
    if not 0.02 * step < wrong < step:  # to save time: these are many
        return
    for rounded, samples, limited in product(ROUNDED[physics], (4, 2), (False, True)):
        how = Transform(samples, "fftfreq", limited, rounded)
        yield f"{SINGLE} (steps of {step:.2g} rad)", propagated(field, setting, physics, how)


def _displaced(image: Tensor, right: Tensor) -> tuple[str, Tensor]:
    """The right image, moved to where it fits best."""
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
    return f"right but ({dy:z.2f}, {dx:z.2f}) px aside", torch.fft.ifft2(spectra[1] * shift)


def _low_passes(
    field: Tensor, image: Tensor, right: Tensor, setting: Setting, physics: Physics
) -> Iterator[tuple[str, Tensor]]:
    """The field without its highest frequencies, from where on as much light is missing as the image lacks."""
    present = float(image.norm() / right.norm()) ** 2
    if not 0.02 < present < 0.98:
        return
    power = torch.fft.fft2(right).abs().square().flatten()
    fy, fx = (torch.fft.fftfreq(size, setting.pitch, dtype=torch.float64) for size in right.shape)
    for name, radius in RADII.items():
        order = torch.argsort(radius(fy[:, None], fx).flatten())
        last = int((power[order].cumsum(0) < present * power.sum()).sum())
        near = float(radius(fy[:, None], fx).flatten()[order[min(last, len(order) - 1)]])
        limits = (near * (1 + step / 100) for step in range(-6, 7))  # an image's edges hide some of the light
        twins = {
            limit: propagated(field, setting, physics, Transform(4, radius=radius, limit=limit)) for limit in limits
        }
        limit, twin = min(twins.items(), key=lambda each: difference(image, each[1], field))
        yield f"a low pass: the band ends at {2 * limit * setting.pitch:.2f} of that of the pixels{name}", twin
