"""A twin becomes a profile: a YAML file, and maps beside it (``display.simulated.maps``).

The stages of the profile have the twin's equations. Its camera has two pixels to one of the panel, so that it adds no
blur to the one that the captures had already.
"""

from __future__ import annotations

import hashlib
import io
import json
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from ...core.errors import UserError
from ...core.io import file_name, write_atomically
from ...display.simulated.maps import LARGEST
from ...display.simulated.profile import Profile
from ...optics.phase import TAU
from ...optics.zernike import NAMES
from ..calibrated.display_model import MODES, SAMPLES, enlarged
from .model import TwinCamera, TwinModel

DENSE = 8 * (TwinModel.SOURCE_GRID - 1) + 1  # points along an axis of a map: every knot, and seven between two
FINEST = 0.5e-6  # m, the smallest pixel of a camera


def to_profile(model: TwinModel, camera: TwinCamera, base: Profile, name: str, folder: Path) -> Path:
    """Write a twin as a profile.

    Parameters
    ----------
    model, camera
        As they have learned.
    base
        Gives the nominal panel, which has to be the model's, and of its camera bits, dark level, well, read noise and
        headroom. The camera looks straight at the picture.
    name
        Of the display; the files are ``name.yaml`` and ``name.npz``.
    folder
        Where they are written; it is created where there is none.

    Returns
    -------
    Path
        Of the YAML file, for ``load_profile`` and every command that takes a display.

    Raises
    ------
    UserError
        The model is of another panel, in a Fourier plane, or its maps are larger than 20 MB.

    Examples
    --------
    >>> from tempfile import mkdtemp
    >>> from holobench_eval.display import load_profile
    >>> base = load_profile("ideal").scaled((64, 64))
    >>> path = to_profile(TwinModel(base.spec()), TwinCamera(base.spec()), base, "lab", Path(mkdtemp()))
    >>> load_profile(str(path)).held[:2]
    ['lut.table', 'lut.gain']
    """
    base, spec = base.scaled(model.spec.shape), model.spec
    if replace(base.spec(), name=spec.name) != spec or spec.plane == "fourier":
        raise UserError(f"'{name}': the model is not of the panel of '{base.name}', or of one in a Fourier plane")
    content = io.BytesIO()
    with torch.no_grad():
        held = {**panel_maps(model), **image_maps(model, camera)}
    arrays: dict[str, Any] = {key: values.detach().cpu().float().numpy() for key, values in held.items()}
    np.savez(content, **arrays)
    packed = content.getvalue()
    if len(packed) > LARGEST:
        raise UserError(
            f"'{name}': maps of {len(packed) / 1e6:.0f} MB; at most {LARGEST / 1e6:g} MB, as of a smaller panel"
        )
    stem = file_name(name)
    figures = base.sensor.bits, base.sensor.dark, base.sensor.full_well, base.sensor.read_noise, base.sensor.headroom
    sensor = dict(zip(("bits", "dark", "full_well", "read_noise", "headroom"), figures, strict=True))
    document = {
        "name": name,
        "version": 1,
        "seed": 0,
        "description": f"The twin of a display, learned from captures, on the panel of {base.name}.",
        "panel": {key: value for key, value in asdict(base.panel).items() if key != "maps"},
        "sampling": SAMPLES,
        "aperture": {"fill": 1.0},
        "sensor": {"pitch": max(FINEST, base.panel.pitch / 2), **sensor},
        "residual_bound": base.residual_bound,
        "maps": {"file": f"{stem}.npz", "size": len(packed), "sha256": hashlib.sha256(packed).hexdigest()},
    }
    lines = "".join(f"{key}: {json.dumps(value)}\n" for key, value in document.items())
    write_atomically(folder / f"{stem}.npz", packed)
    write_atomically(folder / f"{stem}.yaml", lines.encode())
    return folder / f"{stem}.yaml"


def panel_maps(model: TwinModel) -> dict[str, Tensor]:
    """What a twin has of the panel and its light, by ``maps.KEYS``."""
    spec, channels = model.spec, len(model.table)
    size = (min(DENSE, spec.shape[0]), min(DENSE, spec.shape[1]))
    levels = torch.arange(2**spec.bits, device=model.table.device) * (TAU / 2**spec.bits)
    aberration = model.aberration.new_zeros(channels, len(NAMES))
    aberration[:, [NAMES[mode] - 1 for mode in MODES]] = model.aberration
    return {
        "lut.table": model._driven(levels.expand(channels, 1, -1))[:, 0],
        "lut.gain": enlarged(model.gain, size).exp(),
        "crosstalk.width": model.crosstalk.exp()[:, None].expand(-1, 2),
        "illumination.amplitude": enlarged(model.amplitude, size).exp(),
        "illumination.phase": enlarged(model.angle, size),
        "propagation.aberration": aberration,
        "zero_order.field": model.undiffracted,
    }


def image_maps(model: TwinModel, camera: TwinCamera) -> dict[str, Tensor]:
    """What a twin has of the image, by ``maps.KEYS``; the gain behind the response is a power before it."""
    exponent = camera.gamma.exp()
    return {
        "illumination.power": (model.brightness + camera.gain / exponent).exp(),
        "stray_light.share": camera.share.sigmoid(),
        "stray_light.reach": camera.reach.exp(),
        "stray_light.blur": camera.blur.exp(),
        "relay.moved": camera.moved,
        "sensor.shading": _shading(model, camera),
        "sensor.exponent": exponent,
        "sensor.ambient": camera.offset,
    }


def _shading(model: TwinModel, camera: TwinCamera) -> Tensor:
    """The factor over all of the image, ``(C, H, W)``; around the region that of its edge."""
    region, (height, width) = model.spec.region, model.spec.shape
    inside = torch.exp(torch.einsum("cm,mhw->chw", camera.shading, camera.monomials))
    rows = (torch.arange(height) - region.top).clamp(0, region.height - 1)
    columns = (torch.arange(width) - region.left).clamp(0, region.width - 1)
    return inside[:, rows][:, :, columns]
