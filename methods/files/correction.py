"""The correction map of a panel, read from the picture that its maker gives."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np

from ...core.errors import CellError
from ...imaging.convention import Convention, per_colour
from .arrays import read_array

ROUNDING = 1e-3  # of a full turn in radians
MOST_TURNS = 12  # of a map from end to end: of a panel that is uneven by six waves, twice in reflection


def on_panel(convention: Convention, shape: tuple[int, int], colours: int, folder: Path) -> Convention:
    """A convention with its correction map read, for a panel of (rows, columns) in so many colours.

    folder: where a relative path of the map starts. CellError, in one line: a full turn for another number of colours,
    or a map that cannot be used.
    """
    refuse_colours(convention, colours)
    if convention.correction is None:
        return convention
    path = folder / convention.correction.file
    levels = read_array(path)
    if levels.ndim == 3 and levels.shape[-1] == colours:
        levels = np.moveaxis(levels, -1, 0)
    if (
        levels.dtype.kind not in "uif"
        or levels.shape not in (shape, (colours, *shape))
        or not np.isfinite(levels).all()
    ):
        given = " x ".join(map(str, levels.shape))
        raise CellError(f"{path}: a correction of {given} levels; the panel has {shape[0]} x {shape[1]} pixels")
    span = float(np.ptp(levels))
    if levels.dtype.kind == "f" and 0 < span <= math.tau + ROUNDING and not (levels == levels.round()).all():
        raise CellError(
            f"{path}: {levels.dtype} from {levels.min():.4g} to {levels.max():.4g}, as radians or turns; a correction "
            "holds levels: of radians times two_pi_level / 6.2832"
        )
    turns = levels / per_colour(convention.correction.two_pi_level)
    if (most := float(np.ptp(turns))) > MOST_TURNS:
        raise CellError(
            f"{path}: levels from {levels.min():g} to {levels.max():g}, which are {most:.0f} turns; set "
            f"correction.two_pi_level to the level of this {levels.dtype} map that is a turn"
        )
    return replace(convention, turns=turns)


def refuse_colours(convention: Convention, colours: int) -> None:
    """CellError for a full turn of another number of colours than a display has."""
    levels = {"two_pi_level": convention.two_pi_level}
    levels |= {"correction.two_pi_level": convention.correction.two_pi_level} if convention.correction else {}
    for key, level in levels.items():
        if isinstance(level, tuple) and len(level) != colours:
            shown = f"{len(level)} levels for {colours} colour{'s' * (colours != 1)}"
            raise CellError(f"{key}: {shown}; expected one for all, or one for each")
