"""Records from a committed records.csv: what a report needs of a study whose folder of records is not there."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import pandas as pd

from ...study.plan import Plan
from .tables import (
    ALONE_COLUMN,
    FELL_BACK_COLUMN,
    LEARNED_COLUMN,
    MEASURED_COLUMNS,
    MEMORY_COLUMN,
    STOPPED_COLUMN,
    score_columns,
)


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
    scores = score_columns(frame)
    # In the order of the keys of a record's file, in which a report lists parameters.
    cells = ((label, cell.id, json.dumps(cell.description(), sort_keys=True)) for label, cell in plan.labelled())
    return [_record(json.loads(described), label, rows[identity], scores) for label, identity, described in cells]


def _record(cell: dict[str, Any], label: str, row: Mapping[Any, Any], scores: list[str]) -> dict[str, Any]:
    def known(column: str) -> Any:
        value = row.get(column)
        return None if value is None or pd.isna(value) else value

    learned = {
        "sha256": known(LEARNED_COLUMN),
        "captures": known("training_captures"),
        "seconds": known("training_seconds"),
        "fell_back": row.get(FELL_BACK_COLUMN) == "yes",
    }
    return {
        "cell": cell,
        "label": label,
        "state": row["state"],
        "reason": row["reason"],
        "scores": {key: row[key] for key in scores if known(key) is not None},
        **{column: known(column) for column in (*MEASURED_COLUMNS, MEMORY_COLUMN)},
        "alone": known(ALONE_COLUMN),
        "stopped": row.get(STOPPED_COLUMN, ""),
        "learned": learned if learned["sha256"] else None,
    }
