"""Focal stacks and light fields in a plan: at which plane, or through which pupil, each target is seen, and which cells
share a hologram (paper 7.1)."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

from ..core.errors import UserError
from ..datasets.base import digest_of
from ..display import load_profile
from ..display.simulated.changes.kinds import PLACES
from ..display.traits import Traits, traits_of
from .displays import Condition

SCORES = ("psnr_linear_infocus", "ssim_linear_infocus")  # of the part of a picture that is in focus
INFOCUS, VERSION = "infocus", "1"  # the name of these scores, and what is raised whenever a value would change
LENS, STAYS = "refocus", "other_plane"  # the display adds a lens for the plane, or leaves the hologram unchanged
EYE = "eye_pupil"  # the picture is what an eye sees from a place
NEEDS = {"focus": ("plane", ("plane", "mask"), "focal_stacks"), "views": ("view", ("place", "views"), "light_fields")}
"""By measure: what a target is, which functions of a dataset tell of it, and a dataset that has them."""

Target = tuple[str, str]  # name and digest
Showing = list[tuple[Target, Condition]]  # targets, each with the display that it is shown on
Stacks = Mapping[str, tuple[str, float]]  # scene of every target, and its plane or place
View = tuple[str, str, float]  # name, digest, and place of the eye's pupil


def stacks_of(dataset: Any, name: str, measure: str) -> dict[str, tuple[str, float]]:
    """Scene of every target, and its plane [mm on the full panel] or the place of the eye's pupil [radii of the iris];
    nothing for other measures. UserError for a dataset without, and for places that are none."""
    if measure not in NEEDS:
        return {}
    part, functions, such = NEEDS[measure]
    if not all(callable(getattr(dataset, function, None)) for function in ("scene", *functions)):
        raise UserError(f"dataset '{name}' has no {part}s; measure: {measure} needs one that has, such as {such}")
    where = getattr(dataset, functions[0])
    found = {item: (dataset.scene(item), float(where(item))) for item in dataset.items()}
    if measure == "views":
        for item in found:
            for view in (item, *dataset.views(item)):
                if not abs(dataset.place(view)) <= 1:
                    raise UserError(f"dataset '{name}': '{view}' is from {dataset.place(view)}; expected {PLACES}")
    return found


def given_views(dataset: Any, item: str) -> list[View]:
    """The views of an item's scene that methods are given, that nearest to the axis first."""
    views = [(view, digest_of(dataset, view), float(dataset.place(view))) for view in dataset.views(item)]
    return sorted(views, key=lambda view: abs(view[2]))


def targets_a_scene(stacks: Stacks) -> int:
    """Planes or views of each scene: a wrong target has to come from another scene, this many targets on."""
    return len(stacks) // len({scene for scene, _ in stacks.values()})


def at_once(method: Traits, measure: str) -> bool:
    """Whether a method receives all planes or views of a scene."""
    return {"focus": method.planes, "views": method.views}.get(measure, False)


def sharing(cls: type[Any], entry_displays: list[Condition], apart: bool) -> list[list[Condition]]:
    """Displays grouped so that the displays of a group share a solution.

    A method that neither captures nor trains nor is privileged knows only the nominal optics, so displays with equal
    nominal optics get the same phase. A trained method knows the display before any change. A method that captures or
    is privileged solves on each display as it is. apart: whether all do.
    """
    traits = traits_of(cls)
    if apart or traits.sees:
        return [[display] for display in entry_displays]
    groups = defaultdict[Any, list[Condition]](list)
    for display in entry_displays:
        groups[(display.name, display.spec) if traits.trains else replace(display.spec, name="")].append(display)
    return list(groups.values())


def showings(
    method: type[Any], group: Sequence[Condition], targets: Sequence[Target], stacks: Stacks, measure: str
) -> Iterator[Showing]:
    """The targets and displays of each solution of a method.

    Planes: a method with ``planes = True`` computes a hologram for all planes of a scene, for displays with equal plane
    spacing. Other methods compute a hologram for each target, and the display moves it to the target's plane. Views: a
    hologram a scene, which is made of `given_views`, or of the first of them by a method without ``views = True``.
    """
    scenes = dict.fromkeys(stacks[name][0] for name, _ in targets)
    by_scene = [[target for target in targets if stacks[target[0]][0] == scene] for scene in scenes]
    if measure == "views":
        for views in by_scene:
            places = [f"{stacks[name][1]:g}" for name, _ in views]
            seen = zip(views, places, strict=True)
            yield [(view, replace(display, change=(EYE, place))) for view, place in seen for display in group]
    elif not traits_of(method).planes:
        for target in targets:
            yield [(target, _at(display, LENS, stacks[target[0]][1])) for display in group]
    else:
        alike = defaultdict[float, list[Condition]](list)
        for display in group:
            alike[offset(display, {STAYS: 1.0})].append(display)
        for planes in by_scene:
            for subgroup in alike.values():
                yield [(target, _at(display, STAYS, stacks[target[0]][1])) for target in planes for display in subgroup]


def _at(display: Condition, kind: str, millimetres: float) -> Condition:
    return display if millimetres == 0 else replace(display, change=(kind, millimetres))


def offset(display: Condition, change: Mapping[str, Any]) -> float:
    """Distance of a cell's plane from the plane of its display [m], scaled to the display's panel."""
    full = load_profile(display.source, folder=display.folder).panel.distance
    return float(sum(change.values())) * 1e-3 * display.spec.distance / full
