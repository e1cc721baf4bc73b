"""Captures scored, matched, shown and compared; the levels of a phase as a picture; the records of a report."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from ..core.device import find
from ..core.errors import CellError, UserError
from ..core.io import write_png
from ..core.schema import checked
from ..display.phases import check_radians, unit_doubt
from ..imaging.convention import Convention
from ..methods.files.correction import on_panel
from ..metrics import catalogue, match
from ..metrics import score as _score
from ..optics.colour import srgb_encode
from ..study.folders.doubts import LIFTED
from ..study.folders.exposure import darkest
from ..study.folders.pairing import exchange
from .described import Scores, refuse_swapped
from .given import LIGHT, RADIANS, Numbers, as_in_config, capture_of, names, path_of, tensor_of, warn_of_levels

if TYPE_CHECKING:
    import pandas as pd

ENDINGS = (".png", ".jpg", ".jpeg")


def score(
    capture: Numbers,
    target: Numbers,
    metrics: Sequence[str] | None = None,
    values: str | None = None,
    device: str = "cpu",
) -> dict[str, float]:
    """The scores of a capture by the metric protocol, by their names.

    Parameters
    ----------
    capture
        ``(C, h, w)``, aligned with the target: floating point is linear light in any unit.
    target
        ``(C, h, w)`` linear light in [0, 1] as floating point. In the other order the two have another score, and are
        refused where they come from an open display as they are.
    metrics
        Names, such as ``["psnr", "ssim"]``; None for all that can be computed here.
    values
        What the numbers of the capture are: ``"linear"``, counts of light; or ``"srgb"``, levels as pictures store
        them, which are decoded. A capture of integers is refused without it.
    device
        Where the metrics compute, see ``open_display``.

    Returns
    -------
    dict
        Scores by name; ``psnr_linear`` [dB] is the one that reports lead with. In the columns of a study the unit ends
        the name: ``psnr_linear_db``.

    Raises
    ------
    UserError
        Other shapes or values, or an unknown metric.
    """
    computed = [metric.name for metric in catalogue() if metric.available() is None] if metrics is None else metrics
    refuse_swapped(capture, target)
    light, wanted, where = capture_of(capture, "a capture", values), tensor_of(target, "a target", LIGHT), find(device)
    try:
        found = _score(light.to(where), wanted.to(where), metrics=names(computed, "metrics"))
    except ValueError as error:
        raise UserError(str(error)) from None
    lost = [name for name in metrics or () if not any(key.startswith(name) for key in found)]
    if lost:
        rows, columns = light.shape[1:]
        raise UserError(f"metrics: {', '.join(lost)} cannot be computed here of {rows} x {columns} pixels")
    warn_of_levels(wanted.numpy(), stacklevel=2)
    if darkest(light, wanted) < -LIFTED:
        text = f"the capture is darker than the target where it is darkest, by more than {LIFTED:.0%} of its white"
        warnings.warn(f"{text}: dark counts that are too high do that", stacklevel=2)
    if swapped := exchange(light, wanted):
        warnings.warn(swapped, stacklevel=2)
    return Scores(found)


def picture(capture: Numbers, target: Numbers, values: str | None = None) -> NDArray[np.uint8]:
    """A capture as it is scored, matched in brightness to its target, for the eye.

    Parameters
    ----------
    capture, target, values
        As in ``score``.

    Returns
    -------
    ndarray
        ``(h, w, 3)`` sRGB levels, as ``matplotlib.pyplot.imshow`` and Pillow take them.

    Raises
    ------
    UserError
        Other shapes or values.
    """
    refuse_swapped(capture, target)
    light, wanted = capture_of(capture, "a capture", values), tensor_of(target, "a target", LIGHT)
    if light.ndim != 3 or light.shape != wanted.shape:
        raise UserError(f"a capture of {tuple(light.shape)} and a target of {tuple(wanted.shape)}; expected (C, h, w)")
    return (255 * _picture(match(light, wanted)[0])).round().astype(np.uint8)


def save_levels(phase: Numbers, path: str | Path, **convention: Any) -> Path:
    """Write a phase as the levels of a panel of 8 bits, a PNG with a channel for each colour.

    Parameters
    ----------
    phase
        ``(C, H, W)`` [rad], C = 1 or 3: ``phase[:1]`` is the first colour alone.
    path
        Of the picture, which ends in .png. Its folder is made where there is none.
        ``display.solve("phases", target, file=path)`` reads it back.
    **convention
        What the levels mean, by the keys of ``phase`` in the file of a bench: ``two_pi_level`` (256 unless given; a
        list has one for each colour), ``sign``, ``origin``, ``correction``, ``flip_horizontal``, ``flip_vertical``.

    Returns
    -------
    Path
        The picture.

    Raises
    ------
    UserError
        Another shape, values that are no radians, or an unknown key or value.
    """
    place, radians = path_of(path, "path"), tensor_of(phase, "a phase", RADIANS)
    if place.suffix.lower() != ".png":
        raise UserError(f"path: '{path}' should end in .png")
    if radians.ndim != 3 or len(radians) not in (1, 3) or 0 in radians.shape:
        raise UserError(f"a phase of {tuple(radians.shape)}; expected (C, H, W) of 1 or 3 colours, of frames one each")
    given = {name: as_in_config(value) for name, value in convention.items()}
    try:
        check_radians(radians, "a ")
        meaning = on_panel(checked(Convention, given, "the panel"), (*radians.shape[1:],), len(radians), Path())
    except CellError as error:
        raise UserError(str(error)) from None
    doubt = unit_doubt(radians)
    for line in (doubt and f"the phase {doubt}", meaning.out_of_reach):
        if line:
            warnings.warn(line, stacklevel=2)
    write_png(place, torch.from_numpy(meaning.levels(radians)), bits=8)
    return place


def compare(target: Numbers, captures: Mapping[str, Numbers], path: str | Path = "compared.jpg") -> Path:
    """Draw captures side by side with their target, each with its scores, an enlarged window and the error in it.

    Parameters
    ----------
    target
        ``(C, h, w)`` linear light in [0, 1].
    captures
        ``(C, h, w)`` linear light as floating point, by the names of their columns.
    path
        Of the picture: a PNG or a JPEG, as it ends in .png, .jpg or .jpeg. Its folder is made where there is none.

    Returns
    -------
    Path
        The picture.

    Raises
    ------
    UserError
        No captures, other shapes or values, or a path that ends otherwise.
    """
    from ..report.charts.tiles import draw_comparison

    place = path_of(path, "path")
    if place.suffix.lower() not in ENDINGS:
        raise UserError(f"path: '{path}' should end in {', '.join(ENDINGS)}")
    if place.is_dir():
        raise UserError(f"path: '{path}' is a folder; expected a file in it")
    if not isinstance(captures, Mapping) or not all(isinstance(name, str) for name in captures):
        raise UserError('captures: expected arrays by their names, such as {"wirtinger": image}')
    if not captures:
        raise UserError("no captures to compare")
    wanted = tensor_of(target, "a target", LIGHT)
    images = {name: tensor_of(capture, f"capture '{name}'", LIGHT) for name, capture in captures.items()}
    for name, image in images.items():
        if image.shape != wanted.shape:
            raise UserError(
                f"capture '{name}' of {tuple(image.shape)}; expected that of the target, {tuple(wanted.shape)}"
            )
    columns = []
    for name, image in images.items():
        scores = score(image, target=wanted, metrics=("psnr", "ssim"))
        note = f"PSNR {scores['psnr_linear']:.2f} dB, SSIM {scores['ssim_linear']:.3f}"
        columns.append((name, note, _picture(match(image, wanted)[0])))
    title = "captures, each at the brightness that fits best"
    try:
        place.parent.mkdir(parents=True, exist_ok=True)
        draw_comparison(place, title, _picture(wanted), columns)
    except OSError as error:
        raise UserError(f"path: '{path}' cannot be written: {error.strerror or error}") from None
    return place


def load_records(folder: str | Path) -> pd.DataFrame:
    """The records of a report, one row for each cell.

    Parameters
    ----------
    folder
        Of the report, with a ``records.csv``.

    Returns
    -------
    DataFrame
        Columns as ``columns.md`` beside every report lists them.

    Raises
    ------
    UserError
        There is no such file, or it is damaged.
    """
    from ..report.compare import read_run

    return read_run(path_of(folder, "folder"))


def _picture(light: Tensor) -> NDArray[np.float64]:
    picture = srgb_encode(light).permute(1, 2, 0).double().numpy()
    return np.repeat(picture, 3, axis=2) if picture.shape[2] == 1 else picture
