"""Methods and metrics that need what is not installed here: found out before anything is computed."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..core import plugins
from ..core.errors import UserError
from ..core.hashing import canonical

if TYPE_CHECKING:
    from .config import Study
    from .plan import Cell, Plan


def refuse_unavailable(plan: Plan, missing: frozenset[str], folder: Path) -> None:
    """UserError, in one line, if a method of a missing cell says by ``available()`` that it cannot run here.

    Only what is to be computed is asked for: a report of what was computed elsewhere needs no method of its study.
    """
    seen: set[str] = set()
    for task in plan.tasks:
        if task.is_floor or not missing.intersection(one.id for one in task.cells):
            continue
        for name, params in _used(task.cells[0]):
            made = canonical([name, params])
            if made not in seen:
                seen.add(made)
                reason = _reason(name, params, folder)
                if reason is not None:
                    raise UserError(f"method '{name}' cannot run here: {reason}")


def refuse_unscored(study: Study) -> None:
    """UserError, in one line, if a metric that the study names, or that its headline is of, cannot be computed here."""
    from ..metrics import catalogue

    weights, wanted = study.protocol.lpips_weights, study.protocol.metrics or ()
    for metric in catalogue(None if weights is None else Path(weights)):
        if (metric.name in wanted or study.headline in metric.columns) and (reason := metric.available()):
            raise UserError(f"metric '{metric.name}' cannot be computed here: {reason}")


def _used(cell: Cell) -> list[tuple[str, dict[str, Any]]]:
    """Names and parameters of a cell's method and of the one whose holograms it predicts."""
    used = [(cell.method, dict(cell.params))]
    return [*used, (cell.holograms["name"], dict(cell.holograms["params"]))] if cell.holograms else used


def _reason(name: str, params: dict[str, Any], folder: Path) -> str | None:
    method: Any = plugins.build("methods", name, params, folder)
    ask = getattr(method, "available", None)
    if not callable(ask):
        return None
    try:
        reason: str | None = ask()
    except Exception as error:  # a stranger's code
        return " ".join(f"{type(error).__name__}: {error}".split())[:300]
    return reason
