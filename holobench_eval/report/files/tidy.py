"""The frames of records.csv, table.csv and tests.csv, each complete without the config.

Parameters of a method stand in table.csv alone: repeated in every record, they were a third of records.csv.
"""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pandas as pd

from ...display.simulated.changes import KINDS
from ...study.plan import REFERENCE
from ..data.categories import FLOOR
from ..data.columns import RATIO, file_name
from ..data.layout import Layout
from ..data.results import Results
from ..data.tables import CATEGORY_COLUMN, CLUSTER_COLUMN

_KEYS = ("study", "measure", "display", "condition", "method", "label", "category")
_SWEPT = ("swept", "swept_value", "swept_unit", "swept_name")
_CELL = ("capture_limit", "panel_height_px", "panel_width_px")
_TARGET = ("target", "cluster", "repeat", "seed")
_Change = tuple[str, float, str, str]  # the columns _SWEPT
_UNCHANGED: _Change = ("", np.nan, "", "")


def tidy_records(frame: pd.DataFrame, layout: Layout) -> pd.DataFrame:
    """The frame of records.csv: a row a cell, ``tables.read_records`` gives the records frame back.

    frame: a records frame, of a run or read from an earlier records.csv; layout: of its study.
    """
    tidy = frame.rename(columns=file_name)
    tidy["study"], tidy["measure"] = layout.study, layout.measure
    tidy["display"] = tidy["display"].where(tidy["display"] != "", tidy["condition"])
    if "category" in tidy:
        tidy["category"] = tidy["category"].replace("", FLOOR)
    tidy["capture_limit"] = [float(layout.capture_limits.get(label, np.nan)) for label in tidy["label"]]
    panels = [layout.panels.get(display, (np.nan, np.nan)) for display in tidy["display"]]
    tidy["panel_height_px"], tidy["panel_width_px"] = ([float(panel[side]) for panel in panels] for side in (0, 1))
    changes = _changes(layout)
    swept = [
        changes.get(condition) or _plane(layout, target)
        for condition, target in zip(tidy["condition"], tidy["target"], strict=True)
    ]
    for index, name in enumerate(_SWEPT):
        tidy[name] = [change[index] for change in swept]
    if CLUSTER_COLUMN not in tidy:
        tidy[CLUSTER_COLUMN] = tidy["target"]
    tidy["seed"] = layout.seed
    return _led(tidy, (*_KEYS, *_CELL, *_SWEPT, *_TARGET))


def tidy_table(results: Results) -> pd.DataFrame:
    """The frame of table.csv: a row per method and condition."""
    tidy, layout, changes = results.table.rename(columns=file_name), results.layout, _changes(results.layout)
    pairs = list(zip(tidy["label"], tidy["condition"], strict=True))
    tidy["study"], tidy["measure"] = layout.study, layout.measure
    tidy["display"] = [_display(results, label, condition) for label, condition in pairs]
    tidy["method"] = [results.cells(label, condition)["name"].iloc[0] for label, condition in pairs]
    if CATEGORY_COLUMN in results.table:
        tidy["category"] = tidy["category"].replace("", FLOOR)
    for index, name in enumerate(_SWEPT):
        tidy[name] = [changes.get(condition, _UNCHANGED)[index] for _, condition in pairs]
    tidy["parameters"] = [_json(layout.params.get(label, {})) for label in tidy["label"]]
    if "clusters" not in tidy:
        tidy["clusters"] = tidy["n"]
    return _led(tidy, (*_KEYS, "parameters", *_SWEPT, "n", "failed", "clusters"))


def tidy_tests(results: Results) -> pd.DataFrame:
    """The frame of tests.csv: a row for every paired test of the report, none without a baseline."""
    unit = f"_{results.headline.unit.lower()}" if results.headline.unit else ""
    columns = ["study", "measure", "display", "condition", "method", "label", "baseline", "metric"]
    counts = ["n", "clusters", "better"]
    differences = [f"difference{end}{unit}" for end in ("", "_lo", "_hi", "_median")]
    rows = [
        (
            results.layout.study,
            results.layout.measure,
            _display(results, test.second, test.condition),
            test.condition,
            results.cells(test.second, test.condition)["name"].iloc[0],
            test.second,
            test.first,
            file_name(results.headline.key),
            test.estimate.n,
            test.estimate.clusters,
            sum(results.headline.better(float(value), 0.0) for value in test.known),
            *(test.estimate.mean, test.estimate.low, test.estimate.high),
            float(np.median(test.known)) if test.known.size else np.nan,
            test.p,
        )
        for test in (results.against_baseline if results.layout.baseline else ())
    ]
    return pd.DataFrame(rows, columns=[*columns, *counts, *differences, "p_adjusted"])


def _changes(layout: Layout) -> dict[str, _Change]:
    """What was changed under every condition that is a change of another."""
    found: dict[str, _Change] = {REFERENCE: _UNCHANGED}
    for sweep in layout.sweeps:
        kind = KINDS[sweep.kind]
        for value, condition in sweep.points:
            if kind.numeric or kind.counted:
                unit = RATIO if kind.unit.startswith("of ") else kind.unit
                found[condition] = (sweep.kind, float(f"{float(value):.6g}"), unit, "")
            else:
                found[condition] = (sweep.kind, np.nan, "", str(value))
    return found


def _plane(layout: Layout, target: str) -> _Change:
    """The plane of a target of a focal stack, which is a change of its display."""
    return ("plane", layout.planes[target][1], "mm", "") if target in layout.planes else _UNCHANGED


def _display(results: Results, label: str, condition: str) -> str:
    """The name of the display of a row."""
    return str(results.cells(label, condition)["profile"].iloc[0]) or condition


def _json(params: Any) -> str:
    return json.dumps(params, sort_keys=True, ensure_ascii=False)


def _led(tidy: pd.DataFrame, first: tuple[str, ...]) -> pd.DataFrame:
    """The frame with these of its columns first."""
    present = [name for name in first if name in tidy]
    return tidy[[*present, *tidy.columns.drop(present)]]
