"""Solved phases, kept by name: each is solved once for all displays, conditions and studies of a results folder."""

from __future__ import annotations

import io
import math
import time
from collections.abc import Callable, Iterable, Mapping
from contextlib import AbstractContextManager
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from ..core import plugins
from ..core.hashing import digest
from ..core.io import locked, sealed, unsealed, write_atomically
from ..display.account import Journal
from ..display.metered import Solver
from ..display.traits import traits_of
from . import isolation
from .artifacts import packed, read_tensors
from .cost import Cost
from .versions import method_version

RESULTS = "holoeval-results"  # the folder of all studies that are given no other
LEVELS = 2**16  # of a start, to a turn: steps of 0.1 mrad, a 256th of the finest that a panel of 8 bits shows


@dataclass(frozen=True)
class Solution:
    """What a method found.

    phase: ``(C, H, W)`` [rad]; captures: that it took; cost: without the memory where another method began with it;
    stopped: why the display ended it (empty: it did not); learned: sha256 of what the method had learned (empty:
    nothing); alone: whether it was timed without concurrent workers; covered, uncovered: what a user's code was seen to
    read (``isolation.Reads``); reused: whether it is from before; shown: frames of its captures (None: unknown).
    """

    phase: Tensor
    captures: int
    cost: Cost
    stopped: str = ""
    learned: str = ""
    alone: bool = True
    covered: dict[str, str] = field(default_factory=dict)
    uncovered: tuple[str, ...] = ()
    reused: bool = False
    shown: int | None = None


@dataclass(frozen=True)
class Phases:
    """The phases of a results folder.

    study: the folder of the study that asks, from which paths of files start; own: that of its output's phases whose
    methods took more than is covered, which no other output may take over (None: the same).
    """

    folder: Path
    study: Path = Path()
    own: Path | None = None

    def path(self, identity: str) -> Path:
        """The file of a phase."""
        own = (self.own or self.folder) / f"{identity}.pt"
        return own if own.exists() else self.folder / own.name

    def read(self, identity: str, learned: str | None = "") -> Solution | None:
        """The solution of a name; None where there is none that is whole, one by another training of the method, or one
        whose method read a file that has changed.

        learned: sha256 of what the method has learned, None for any.
        """
        known = self._read(identity)
        if known is None or learned not in (None, known.learned) or isolation.changed(known.covered, self.study):
            return None
        return known

    def fault(self, identity: str) -> str:
        """Why a phase whose file is there is not taken, and what to do, in words."""
        known = self._read(identity)
        if known is None:
            return "is damaged; delete the file and run again"
        return f"was solved with another {isolation.changed(known.covered, self.study)} than is there now; run again"

    def _read(self, identity: str) -> Solution | None:
        path = self.path(identity)
        file = unsealed(path.read_bytes(), identity) if path.is_file() else None
        if file is None:
            return None
        content = read_tensors(path, io.BytesIO(file))
        return Solution(**content | {"cost": Cost(**content["cost"])}, reused=True)

    def locked(self, identity: str) -> AbstractContextManager[None]:
        """Let others that want a phase wait, here and in other studies, so that its captures are taken and counted
        once."""
        return locked(self.folder / f"{identity}.lock")

    def journal(self, identity: str) -> Journal:
        """The captures that a phase takes, in all attempts, until it is kept."""
        return Journal(self.folder / f"{identity}.captures")

    def captures(self, identity: str) -> int:
        """The captures that a phase took so far, found or not."""
        known = self.read(identity, None)
        return self.journal(identity).captures or (known.captures if known else 0)

    def keep(self, identity: str, solution: Solution) -> None:
        """Keep a solution, in the place of an earlier one, and close its account."""
        content = {name: value for name, value in vars(solution).items() if name != "reused"}
        file, own = sealed(packed(content | {"cost": asdict(solution.cost)}), identity), self.own or self.folder
        path = (own if solution.uncovered else self.folder) / f"{identity}.pt"
        write_atomically(path, file, lasting=solution.captures > 0)
        if self.path(identity) != path:
            self.path(identity).unlink()
        self.journal(identity).close()

    def remove(self, identities: Iterable[str]) -> None:
        """Remove phases with their accounts, where they are."""
        for identity in identities:
            for path in {self.path(identity), self.folder / f"{identity}.pt"}:
                path.unlink(missing_ok=True)
            self.journal(identity).close()


@dataclass
class Starts:
    """The phases of one target that other methods begin with, each by a method that knows the nominal optics alone.

    basis: what such a phase depends on besides its method, see ``identity.phase``; device: where it is needed; reads:
    what was read for the target; before: those that are from before: what they took is part of what a method costs that
    begins with them.
    """

    phases: Phases
    basis: Mapping[str, Any]
    device: torch.device
    reads: isolation.Reads = field(default_factory=isolation.Reads)
    before: list[Solution] = field(default_factory=list)

    def __call__(self, method: Solver, solve: Callable[[], Tensor]) -> Tensor:
        """The phase ``(1, C, H, W)`` of a method: kept from before, or solved now and kept.

        A class that is no registered method by itself has no version of its own, and is always solved.
        """
        traits = traits_of(method)
        if not plugins.is_registered("methods", type(method)) or traits.sees or traits.trains:
            return solve()
        identity = digest({**self.basis, "code": method_version(type(method)), "params": plugins.params_of(method)})
        if (known := self.phases.read(identity)) is not None:
            self.before.append(known)
            return known.phase[None].to(self.device)
        began, earlier = time.perf_counter(), len(self.before)
        phase = solve()
        cost = Cost(time.perf_counter() - began).after(known.cost for known in self.before[earlier:])
        solved = Solution(phase.detach().cpu()[0], 0, cost, alone=False, shown=0, **vars(self.reads))
        self.phases.keep(identity, solved)
        return phase


def phases_of(output: Path, study: Path = Path(), part: str = "") -> Phases:
    """The phases that a study with this output folder shares: with all of ``holoeval-results``, else with its parts.

    part: the name of the study where it is a part, whose folder lies in that of its study.
    """
    own, first = output / "solved", output.parent if part and output.name == part else output
    beside = first.absolute().parent
    shared = (beside if beside.name == RESULTS else first) / "solved"
    return Phases(own, study) if shared == own else Phases(shared, study, own)


def start_of(phase: Tensor) -> Tensor:
    """A phase ``(C, H, W)`` [rad] as other methods start from it, in ``LEVELS``."""
    levels = (phase.double() / math.tau * LEVELS).round().remainder(LEVELS)
    return levels.float() * (math.tau / LEVELS)
