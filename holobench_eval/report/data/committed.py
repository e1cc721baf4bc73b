"""Records from a committed records.csv: what a report needs of a study whose folder of records is not there."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pandas as pd

from ...study.plan import Plan
from .scores import parse
from .tables import score_columns


def difference(frame: pd.DataFrame, plan: Plan) -> str:
    """How the cells of a records frame differ from those that are planned now, in words; empty where they do not."""
    planned, measured = {cell.id for cell in plan.cells}, set(frame["cell"])
    parts = [(len(planned - measured), f"of {len(planned)} planned cells are not in records.csv")]
    parts += [(len(measured - planned), f"of {len(measured)} cells in records.csv are not planned")]
    return ", ".join(f"{count} {text}" for count, text in parts if count)


def committed_records(frame: pd.DataFrame, plan: Plan) -> list[dict[str, Any]]:
    """A record for every cell of a plan, as ``Store.load`` gives them under the plan's labels.

    frame: a records frame that has all of them, see ``difference``.
    """
    rows = {row["cell"]: row for row in frame.to_dict("records")}
    scores = {parse(name).key: name for name in score_columns(frame)}
    return [_record(cell.facts(), label, rows[cell.id], scores) for label, cell in plan.labelled()]


def _record(cell: dict[str, Any], label: str, row: Mapping[Any, Any], scores: Mapping[str, str]) -> dict[str, Any]:
    """What a report asks records for; the numbers of its tables come from ``row``."""
    sha256 = row.get("learned_sha256")
    return {
        "id": row["cell"],
        "cell": cell,
        "label": label,
        "state": row["state"],
        "scores": {key: row[name] for key, name in scores.items() if not pd.isna(row[name])},
        "learned": {"sha256": sha256} if sha256 else None,
        "row": {**row, "label": label},
    }
