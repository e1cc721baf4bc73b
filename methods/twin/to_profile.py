"""A twin becomes a profile: a YAML file, and maps beside it (``display.simulated.maps``).

The stages of the profile have the twin's equations. Its camera has two pixels to one of the panel, so that it adds no
blur to the one that the captures had already.
"""

from __future__ import annotations

import hashlib
import io
import json
from collections.abc import Mapping
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
from ..calibrated.display_model import SAMPLES, enlarged
from .model import TwinCamera, TwinModel

DENSE = 8 * (TwinModel.SOURCE_GRID - 1) + 1  # points along an axis of a map: every knot, and seven between two
FINEST = 0.5e-6  # m, the smallest pixel of a camera


def to_profile(model: TwinModel, camera: TwinCamera, base: Profile, folder: Path) -> Path:
    """Write a twin as a profile.

    Parameters
    ----------
    model, camera
        As they have learned.
    base
        Gives the name, the nominal panel, which has to be the model's, what is known of the twin, and of its camera
        bits, dark level, well, read noise and headroom. The camera looks straight at the picture.
    folder
        Where the files are written, ``NAME.yaml`` and ``NAME.npz``; it is created where there is none.

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
    >>> base = replace(load_profile("ideal").scaled((64, 64)), name="lab")
    >>> path = to_profile(TwinModel(base.spec()), TwinCamera(base.spec()), base, Path(mkdtemp()))
    >>> load_profile(str(path)).held[:2]
    ['lut.table', 'lut.gain']
    """
    base, spec = base.scaled(model.spec.shape), model.spec
    if replace(base.spec(), name=spec.name) != spec or spec.plane == "fourier":
        raise UserError(f"'{base.name}': the model is not of this panel, or of one in a Fourier plane")
    with torch.no_grad():
        return write_profile({**panel_maps(model), **image_maps(model, camera)}, base, folder)


def write_profile(held: Mapping[str, Tensor], base: Profile, folder: Path) -> Path:
    """Write a profile of maps, by ``maps.KEYS``, and of a nominal panel and a camera; see ``to_profile``."""
    content, stem = io.BytesIO(), file_name(base.name)
    arrays: dict[str, Any] = {key: values.detach().cpu().float().numpy() for key, values in held.items()}
    np.savez(content, **arrays)
    packed = content.getvalue()
    if len(packed) > LARGEST:
        raise UserError(
            f"'{base.name}': maps of {len(packed) / 1e6:.0f} MB; at most {LARGEST / 1e6:g} MB, as of a smaller panel"
        )
    sensor = {key: getattr(base.sensor, key) for key in ("bits", "dark", "full_well", "read_noise", "headroom")}
    entries = {
        "sampling": SAMPLES,
        "aperture": {"fill": 1.0},
        "sensor": {"pitch": max(FINEST, base.panel.pitch / 2), **sensor},
        **({"lut": {"table": base.panel.levels}} if base.panel.levels and "lut.table" not in held else {}),
    }
    return write_learned(base, entries, "maps", {}, f"{stem}.npz", packed, folder)


def write_learned(
    base: Profile,
    entries: Mapping[str, Any],
    key: str,
    facts: Mapping[str, Any],
    file: str,
    content: bytes,
    folder: Path,
) -> Path:
    """Write a profile of the nominal panel of ``base``, and the file beside it that ``key`` names; the profile's path.

    entries: further ones of the profile; facts: what ``key`` says besides the file's name, size and SHA-256.
    """
    document = {
        "name": base.name,
        "version": base.version,
        "seed": 0,
        "description": base.description,
        "panel": {name: value for name, value in asdict(base.panel).items() if name != "maps"},
        "residual_bound": base.residual_bound,
        **entries,
        key: {**facts, "file": file, "size": len(content), "sha256": hashlib.sha256(content).hexdigest()},
        **({"twin": asdict(base.twin)} if base.twin.of else {}),
    }
    write_atomically(folder / file, content)
    path = folder / f"{file_name(base.name)}.yaml"
    write_atomically(path, "".join(f"{name}: {json.dumps(value)}\n" for name, value in document.items()).encode())
    return path


def panel_maps(model: TwinModel) -> dict[str, Tensor]:
    """What a twin has of the panel and its light, by ``maps.KEYS``."""
    spec, channels = model.spec, len(model.table)
    size = (min(DENSE, spec.shape[0]), min(DENSE, spec.shape[1]))
    rows, columns = model.specks.shape[2:]
    finest, specks = (rows, columns), model.dirt((rows, columns))
    levels = torch.arange(2**spec.bits, device=model.table.device) * (TAU / 2**spec.bits)
    aberration = model.aberration.new_zeros(channels, len(NAMES))
    aberration[:, [NAMES[mode] - 1 for mode in model.MODES]] = model.aberration
    return {
        "lut.table": model._driven(levels.expand(channels, 1, -1))[:, 0],
        "lut.gain": enlarged(model.gain, size).exp(),
        "crosstalk.width": model.crosstalk.exp()[:, None].expand(-1, 2),
        "illumination.amplitude": (enlarged(model.amplitude, finest) + specks[0]).exp(),
        "illumination.phase": enlarged(model.angle, finest) + specks[1],
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
    inside = camera.shaded()
    rows = (torch.arange(height) - region.top).clamp(0, region.height - 1)
    columns = (torch.arange(width) - region.left).clamp(0, region.width - 1)
    return inside[:, rows][:, :, columns]
