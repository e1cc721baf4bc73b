"""The pictures a study leaves beside its scores: thumbnails, and on request captures and phases."""

from __future__ import annotations

import io
import json
import math
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from ...core.io import write_atomically, write_png
from ...optics.colour import srgb_encode

LONGEST_THUMBNAIL = 512


def write_thumbnail(path: Path, linear: Tensor) -> None:
    """Write linear light ``(C, h, w)`` in [0, 1] as an 8-bit sRGB PNG, its longer side at most 512 pixels."""
    shrink = max(linear.shape[-2:]) / LONGEST_THUMBNAIL
    if shrink > 1:
        size = [max(1, round(side / shrink)) for side in linear.shape[-2:]]
        linear = torch.nn.functional.interpolate(linear[None], size=size, mode="bilinear", antialias=True)[0]
    write_png(path, (srgb_encode(linear) * 255).round(), bits=8, lasting=False)


def write_capture(path: Path, linear: Tensor) -> None:
    """Write a rectified capture ``(C, h, w)`` as a 16-bit linear PNG, with its scale in a JSON file beside
    it.

    Light in units of the mean incident intensity on the panel is the PNG's value times the scale.
    """
    scale = max(float(linear.max()), 1e-12) / 65535
    write_png(path, (linear.clamp_min(0) / scale).round(), bits=16)
    colours = {"channels": "red, green, blue"} if len(linear) > 1 else {}
    note = {"scale": scale, "unit": "mean incident intensity on the panel", **colours}
    write_atomically(path.with_suffix(".json"), f"{json.dumps(note, indent=1)}\n".encode())


def write_phase(path: Path, phase: Tensor) -> None:
    """Write a phase ``(C, H, W)`` [rad] as 8-bit gray levels, 256 levels to 2 pi, a colour channel per wavelength, of
    frames ``(F, C, H, W)`` a picture each; and beside it as .npy, in radians as the method gave it, which the method
    ``phases`` reads."""
    named = [(path, phase)]
    if phase.ndim == 4:
        named = [(path.with_stem(f"{path.stem}-frame-{number}"), frame) for number, frame in enumerate(phase, 1)]
    for file, frame in named:
        write_png(file, (frame.double() / math.tau * 256).round().remainder(256), bits=8)
    exact = io.BytesIO()
    np.save(exact, phase.contiguous().numpy(), allow_pickle=False)
    write_atomically(path.with_suffix(".npy"), exact.getvalue())
