"""Phases of finished cells, kept for the methods that start from them, and what has to be computed again with them."""

from __future__ import annotations

import io
import math
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from ...core.errors import CellError
from ...core.io import TEMPORARY, write_atomically
from ..plan import Cell, Plan
from ..store import Store, appears, late

FOLDER = "starts"
LEVELS = 2**16  # to a turn: steps of 0.1 mrad, a 256th of the finest that a panel of 8 bits shows


def path(store: Store, identity: str) -> Path:
    """The file with the phase of a cell."""
    return store.output / FOLDER / f"{identity}.npy"


def keep(store: Store, identity: str, phase: Tensor) -> None:
    """Write the phase ``(C, H, W)`` [rad] of a cell, before its record."""
    buffer = io.BytesIO()
    levels = (phase.double() / math.tau * LEVELS).round().remainder(LEVELS)
    np.save(buffer, levels.numpy().astype(np.uint16))
    write_atomically(path(store, identity), buffer.getvalue())


def of(store: Store, cell: Cell) -> list[Tensor]:
    """The phases ``(C, H, W)`` [rad] that a cell starts from, those of its ``starts`` that have a score.

    CellError for a record or a phase that does not appear: no start may be left out unseen.
    """
    until = late()
    done = [identity for identity in cell.starts if _is_done(store, identity, until)]
    return [_read(_seen(path(store, identity), until)) for identity in done]


def _is_done(store: Store, identity: str, until: float) -> bool:
    _seen(store.path(identity), until)
    record = store.read(identity)
    return record is not None and record.state == "done"


def _seen(file: Path, until: float) -> Path:
    """The file of a start; another machine may just have written it."""
    if not appears(file, until):
        raise CellError(f"{file} of a method to start from is not there; workers have to see this folder; run again")
    return file


def _read(file: Path) -> Tensor:
    try:
        levels = np.load(file)
    except (OSError, ValueError) as error:
        raise CellError(f"the phase in {file} cannot be read ({error}); delete the file and run again") from error
    return torch.from_numpy(levels.astype(np.float32) * np.float32(math.tau / LEVELS))


def clean(plan: Plan, store: Store) -> None:
    """Remove the phases that no cell of a plan starts from, and files that were not finished; the folder is locked."""
    folder = store.output / FOLDER
    named = {path(store, identity) for cell in plan.cells for identity in cell.starts}
    for file in (*folder.glob("*.npy"), *folder.glob(f"{TEMPORARY}*")):
        if file not in named:
            file.unlink()


def affected(plan: Plan, missing: frozenset[str], store: Store) -> tuple[frozenset[str], frozenset[str]]:
    """The cells to compute where those of ``missing`` have to be, and those whose records hold no longer, by id.

    A cell that starts from a missing one is computed again, since that one may have failed before; not so where that
    one has a score and is only timed again, for its phase stays. A start whose phase was not kept is computed again.
    """
    followers = [cell for cell in plan.cells if cell.starts]
    states = store.states(plan.cells) if followers else {}
    new = {identity for identity in missing if states.get(identity) != "done"}
    outdated = frozenset(cell.id for cell in followers if not new.isdisjoint(cell.starts))
    computed = missing | outdated
    wanted = {identity for cell in followers if cell.id in computed for identity in cell.starts}
    unkept = {identity for identity in wanted if states[identity] == "done" and not path(store, identity).exists()}
    return computed | unkept, outdated
