"""Focal stacks in a plan: at which distance each target is shown, and which cells share a hologram (paper 7.1)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

from ..core.errors import UserError
from ..display import load_profile
from ..display.traits import traits_of
from .displays import Condition

SCORES = ("psnr_linear_infocus", "ssim_linear_infocus")  # of the part of a picture that is in focus
INFOCUS, VERSION = "infocus", "1"  # the name of these scores, and what is raised whenever a value would change
LENS, STAYS = "refocus", "other_plane"  # the display adds a lens for the plane, or leaves the hologram unchanged

Target = tuple[str, str]  # name and digest
Showing = list[tuple[Target, Condition]]  # targets, each with the display that it is shown on


def planes_of(dataset: Any, name: str) -> dict[str, tuple[str, float]]:
    """Scene and plane [mm on the full panel] of every target. UserError for a dataset without planes."""
    if not all(callable(getattr(dataset, part, None)) for part in ("scene", "plane", "mask")):
        raise UserError(f"dataset '{name}' has no planes; measure: focus needs one that has, such as focal_stacks")
    return {item: (dataset.scene(item), float(dataset.plane(item))) for item in dataset.items()}


def planes_a_scene(planes: Mapping[str, tuple[str, float]]) -> int:
    """Planes in each scene: a wrong target has to come from another scene, this many targets on."""
    return len(planes) // len({scene for scene, _ in planes.values()})


def showings(
    method: type[Any], group: Sequence[Condition], targets: Sequence[Target], planes: Mapping[str, tuple[str, float]]
) -> Iterator[Showing]:
    """The targets and displays of each solution of a method.

    A method with ``planes = True`` computes a hologram for all planes of a scene, for displays with equal plane
    spacing. Other methods compute a hologram for each target, and the display moves it to the target's plane.
    """
    if not traits_of(method).planes:
        for target in targets:
            yield [(target, _at(display, LENS, planes[target[0]][1])) for display in group]
        return
    alike: dict[float, list[Condition]] = {}
    for display in group:
        alike.setdefault(offset(display, {STAYS: 1.0}), []).append(display)
    for scene in dict.fromkeys(planes[name][0] for name, _ in targets):
        stack = [target for target in targets if planes[target[0]][0] == scene]
        for subgroup in alike.values():
            yield [(target, _at(display, STAYS, planes[target[0]][1])) for target in stack for display in subgroup]


def _at(display: Condition, kind: str, millimetres: float) -> Condition:
    return display if millimetres == 0 else replace(display, change=(kind, millimetres))


def offset(display: Condition, change: Mapping[str, Any]) -> float:
    """Distance of a cell's plane from the plane of its display [m], scaled to the display's panel."""
    full = load_profile(display.source, folder=display.folder).panel.distance
    return float(sum(change.values())) * 1e-3 * display.spec.distance / full
