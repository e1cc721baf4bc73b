"""Phase retrieval through the model of a display: open loop, as good as what a lab knows of its display."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Annotated, ClassVar, Self

import torch
from annotated_types import MinLen
from torch import Tensor

from ...core.errors import CellError, UserError
from ...display.api import DisplaySpec, Simulation
from ...display.calibrated import CalibratedBench
from ...display.metered import MeteredDisplay
from ...display.simulated.pipeline import SimulatedBench
from ...display.simulated.profile import load_profile, profile_files
from ..fiducials import fiducial_phases
from ..wirtinger import Wirtinger
from .descent import BenchDescent

ROUNDING = 1e-6  # relative difference of two lengths that are the same


@dataclass(frozen=True)
class Through(BenchDescent):
    """Adam on the phase for the expected score on the simulated bench of a profile, which models the display.

    It takes no captures, and knows nothing of the display but its nominal optics: all else is what the profile says,
    to the last random pattern. On a display with that very profile it is as good as an oracle; on any other, as the
    profile is. The profile is scaled to the panel of the display. It descends twice, from ``start_iterations`` of
    Wirtinger and from its converged phase, which is the better start on a display that is nearly ideal (by a dB on
    ``ideal``); on the model it is never worse than that phase.

    The camera of the profile's bench is registered with the fiducial holograms, as the display's is. So what moves the
    picture, the pose of either camera or coma, is taken off on both sides. With the profile's pose undone exactly, and
    the picture compared where nominal optics have it, it went 77 % of the way to the oracle on ``leto-aged`` at 128 px
    in the place of 99 %.

    Parameters
    ----------
    profile : str
        The model of the display: the name of a profile, or the path of its file, from the config's folder.
    """

    profile: Annotated[str, MinLen(1)] = "ideal"

    title: ClassVar[str] = "descent through a model of the display"
    version: ClassVar[int] = 1
    simulates: ClassVar[bool] = True
    _folder: ClassVar[Path] = Path()

    def in_folder(self, folder: Path) -> Self:
        """The same with a profile whose path starts in ``folder``."""
        moved = replace(self)
        object.__setattr__(moved, "_folder", folder)
        return moved

    def external(self) -> dict[str, Path | None]:
        """The files of the profile and of those it is like, by their order."""
        files = profile_files(self.profile, self._folder)
        return {f"file {number} of the profile": path for number, path in enumerate(files, 1)}

    def refuse_display(self, spec: DisplaySpec) -> None:
        """UserError for a display of other nominal optics than the profile's, on the same panel, in one line."""
        profile = load_profile(self.profile, self._folder)
        if profile.network.method:
            raise UserError(f"profile '{self.profile}' is a network, which has no stages to descend through")
        own = profile.spec(spec.shape)
        if faults := list(_differences(own, spec)):
            raise UserError(f"profile '{self.profile}' is no model of '{spec.name}': {'; '.join(faults)}")

    def solve(self, target: Tensor, bench: MeteredDisplay) -> Tensor:
        """Phases of the best expected score on the profile's bench.

        Parameters
        ----------
        target : Tensor
            Linear intensity ``(B, C, h, w)`` in [0, 1].
        bench : MeteredDisplay
            Nominal optics in SI units.

        Returns
        -------
        Tensor
            Phase ``(B, C, H, W)`` [rad].

        Raises
        ------
        CellError
            The display has other nominal optics, or the bench of the profile cannot be registered.
        """
        try:
            self.refuse_display(bench.spec)
        except UserError as error:
            raise CellError(str(error)) from error
        digest = load_profile(self.profile, self._folder).digest
        model = _model(self.profile, self._folder, digest, bench.spec.shape, target.device)
        own = Wirtinger(iterations=self.start_iterations).solve(target, bench)
        starts = zip(target, own, bench.solved(Wirtinger(), target), strict=True)
        return torch.stack([self.best(model, image, early, [converged]) for image, early, converged in starts])


@lru_cache(maxsize=2)
def _model(name: str, folder: Path, digest: str, shape: tuple[int, int], device: torch.device) -> Simulation:
    """The bench of a profile on a panel, as its registered camera sees it. digest: tells its versions apart."""
    bench = SimulatedBench(load_profile(name, folder).scaled(shape), device)
    return CalibratedBench(bench, 0, fiducial_phases).simulation


def _differences(own: DisplaySpec, shown: DisplaySpec) -> Iterator[str]:
    """What the profile says of the panel and what the display does, where it is not the same."""
    for (name, one), other in zip(_told(own).items(), _told(shown).values(), strict=True):
        if len(one) != len(other) or not all(map(_alike, one, other)):
            yield f"its {name} is {_said(one)}, not {_said(other)}"


def _told(spec: DisplaySpec) -> dict[str, tuple[float, ...]]:
    """What profile and display have to agree in."""
    region = spec.region
    return {
        "panel [px]": spec.shape,
        "pitch [m]": (spec.pitch,),
        "list of wavelengths [m]": spec.wavelengths,
        "distance [m]": (spec.distance,),
        "pitch of the picture [m]": (spec.image_pitch,),
        "number of bits": (spec.bits,),
        "blaze [cycles/px]": spec.blaze,
        "region (top, left, height, width) [px]": (region.top, region.left, region.height, region.width),
    }


def _alike(one: float, other: float) -> bool:
    return math.isclose(one, other, rel_tol=ROUNDING)


def _said(numbers: tuple[float, ...]) -> str:
    return ", ".join(f"{number:.6g}" for number in numbers)
