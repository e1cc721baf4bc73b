"""Methods that need what is not installed here: found out before anything is computed."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from .. import registry
from ..errors import UserError
from .identity import canonical

if TYPE_CHECKING:
    from .plan import Cell, Plan


def refuse_unavailable(plan: Plan, missing: frozenset[str], folder: Path) -> None:
    """UserError, in one line, if a method of a missing cell says by ``available()`` that it cannot run here.

    Only what is to be computed is asked for: a report of what was computed elsewhere needs no method of its study.
    """
    seen: set[str] = set()
    for task in plan.tasks:
        cell = task.cells[0]
        if task.is_floor or not missing.intersection(one.id for one in task.cells):
            continue
        made = canonical([cell.method, dict(cell.params)])
        if made not in seen:
            seen.add(made)
            reason = _reason(cell, folder)
            if reason is not None:
                raise UserError(f"method '{cell.method}' cannot run here: {reason}")


def _reason(cell: Cell, folder: Path) -> str | None:
    method: Any = registry.build("methods", cell.method, dict(cell.params), folder)
    reason: str | None = method.available() if hasattr(method, "available") else None
    return reason
