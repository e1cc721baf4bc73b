"""What the photographs of a session say of the bench: its geometry, its drift, and whether they are in order."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from skimage.registration import phase_cross_correlation

from ...core.errors import CellError, UserError
from ...core.io import write_png
from ...imaging.grid import fiducial
from ...imaging.grid_picture import grid_picture
from ..real import RealBench
from . import FolderPhotographer
from .checks import LISTED, check_order, check_swaps, grain, shortened, thumbnail
from .manifest import DARK, REPEAT, Pattern
from .sign import predicted, sign_hint

FURTHEST_DRIFT = 2.0  # region pixels that the bounded refinement of a capture still takes up (protocol, point 3)
FINENESS = 20  # steps a pixel of the correlation that measures drift

Say = Callable[[str], None]


def look(bench: RealBench, photographer: FolderPhotographer, output: Path, say: Say) -> tuple[str, ...]:
    """Register the camera; look for drift and for photographs in the wrong order. UserError for what cannot be used.

    Draws the grid as it was found under ``output``. Returns what a reader of the scores should know, a line each.
    """
    try:
        registration = bench.registration
    except CellError as error:
        hint = sign_hint(bench, photographer)
        raise UserError(f"the camera cannot be registered, and nothing was scored: {error}; {hint}") from None
    residual = f"registration: {max(registration.residual):.2f} px rms"
    second = bench.disagreement
    check = "another algorithm finds none" if np.isnan(second) else f"another algorithm differs by {second:.2f} px"
    say(f"{residual}; {check} at the corners")
    _draw(bench, output / "figures" / "registration.png")
    moved, dimmed = drift(bench, photographer)
    say(f"drift: {moved:.2f} px and {dimmed:.1%} of the light, at most, between the repeats of one hologram")
    if moved > FURTHEST_DRIFT:
        raise UserError(
            f"the camera or the picture moved by {moved:.1f} px between repeats, more than {FURTHEST_DRIFT:g} px; "
            "fix the bench and photograph a new session"
        )
    faults, alike = misplaced(bench, photographer)
    if faults:
        raise UserError("nothing was scored. " + " | ".join(faults))
    if alike:
        say(alike)
    return (
        f"geometry: {residual}, {check} at the corners",
        f"drift between the repeats of one hologram: {moved:.2f} px and {dimmed:.1%} of the light at most",
        *([alike] if alike else []),
    )


def _draw(bench: RealBench, path: Path) -> None:
    """Every colour's photograph of the grid with what was found in it, side by side."""
    grid = fiducial(bench.spec.region.shape)
    frames = enumerate(bench.grid_photograph.cpu().numpy())
    pictures = [grid_picture(frame, grid, bench.registration, channel) for channel, frame in frames]
    write_png(path, torch.from_numpy(np.hstack(pictures)).permute(2, 0, 1), bits=8)


def _rectified(bench: RealBench, photographer: FolderPhotographer, pattern: Pattern) -> NDArray[np.float32]:
    return bench.registration.warps[pattern.colour].sample(photographer.light(pattern))


def drift(bench: RealBench, photographer: FolderPhotographer) -> tuple[float, float]:
    """Largest shift [region px] and relative change of light of the repeated hologram, against its first photograph."""
    first: dict[int, NDArray[np.float32]] = {}
    moved = dimmed = 0.0
    for pattern in photographer.manifest.patterns:
        if pattern.role != REPEAT:
            continue
        seen = _rectified(bench, photographer, pattern)
        before = first.setdefault(pattern.colour, seen)
        if before is seen:
            continue
        pair = (np.sqrt(np.maximum(light, 0)) for light in (before, seen))
        shift, _, _ = phase_cross_correlation(  # type: ignore[no-untyped-call]
            *pair, upsample_factor=FINENESS, normalization=None
        )
        moved = max(moved, float(np.hypot(*shift)))
        dimmed = max(dimmed, abs(float(seen.mean() / before.mean()) - 1))
    return moved, dimmed


def misplaced(bench: RealBench, photographer: FolderPhotographer) -> tuple[list[str], str]:
    """Photographs of another pattern than their name says, a line each; and a line on those that nobody can tell."""
    manifest, faults, alike = photographer.manifest, list[str](), list[str]()
    for number in range(1, manifest.rounds + 1):
        patterns = [pattern for pattern in manifest.of_round(number) if pattern.role != DARK]
        seen, wanted, groups = {}, {}, dict[tuple[str, int], list[Pattern]]()
        for pattern in patterns:
            groups.setdefault((pattern.target, pattern.colour), []).append(pattern)
        for (target, _), group in sorted(groups.items()):
            grains = []
            for pattern in group:
                light, wished = _rectified(bench, photographer, pattern), predicted(bench, photographer, pattern)
                seen[pattern.capture], wanted[pattern.capture] = thumbnail(light), thumbnail(wished)
                grains.append((grain(light), grain(wished)) if target else ())
            if target and len(group) > 1:
                swapped, unknown = check_swaps(group, *zip(*grains, strict=True))
                faults, alike = [*faults, *swapped], [*alike, *unknown]
        faults += check_order(patterns, seen, wanted)
    pairs = f"{len(alike)} pair(s) of photographs of one target cannot be told apart, and may have changed places"
    named = "; ".join(alike[:LISTED]) + (" and others" if len(alike) > LISTED else "")
    return shortened(faults), f"order: {pairs}: {named}" if alike else ""
