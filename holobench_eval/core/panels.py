"""How the size of a panel decides what computes it; a command can ask before it loads torch."""

from __future__ import annotations

import operator
from typing import Any

from .errors import UserError

LARGE = 512 * 1024  # pixels


def is_small(panel: tuple[int, int] | None) -> bool:
    """Whether one thread computes a panel of (rows, columns) as well as several; not for one of unknown size.

    Transforms of small panels gain less than twofold from a second thread, and lose tenfold and more (measured) when
    another program wants the core, since the threads wait for each other after every operation.
    """
    return panel is not None and panel[0] * panel[1] < LARGE


def rows_and_columns(panel: Any) -> tuple[int, int] | None:
    """The two whole numbers of a panel [px], or None. UserError, one line, for anything else."""
    if panel is None:
        return None
    try:
        rows, columns = (operator.index(side) for side in panel)
    except (TypeError, ValueError):
        got = " ".join(str(panel).split())[:60]
        raise UserError(f"panel: expected rows and columns such as (256, 256), or None; got {got}") from None
    return rows, columns
