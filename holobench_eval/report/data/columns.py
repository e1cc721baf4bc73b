"""The columns of records.csv and table.csv, one list: what each holds, and where its values come from.

A function is a column: its name, its docstring the meaning that columns.md states, its value that of a record. Frames
inside this package have the names of the files. Where a column has a unit, the unit is the last part of its name:
``psnr_linear_lo_db``, ``solving_s``. A figure of a run is an entry of ``FIGURES`` and nothing else.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd

from ...study.plan import is_reference
from .column import DONE, Cells, Column, Record, column, first, if_known, if_trained, mean, median
from .layout import FLOOR, Layout
from .text import FILES

Row = Mapping[Any, Any]  # of records.csv, as far as its records say
CELL: list[Column] = []  # what a cell is, before the scores
FIGURES: list[Column] = []  # what was measured beside scores, and its origin, after them


def _median_alone(cells: Cells, name: str) -> float:
    """Over the done cells whose seconds count: what was solved alone if anything was, else all. A machine that stood
    still for minutes does not move it."""
    alone = cells.done[cells.done["timed_alone"] == 1] if "timed_alone" in cells.done else cells.done
    return float((cells.done if alone.empty else alone)[name].median())


def _together(cells: Cells, name: str) -> str:
    """The texts of the done cells, each once."""
    return " ".join(sorted({*cells.done[name]} - {""}))


def _learned(record: Record, key: str, untrained: Any, unknown: Any) -> Any:
    """A fact of the training behind a score, and what stands for it where nothing was trained or scored."""
    return (record.get("learned") or {}).get(key, untrained) if record["state"] == DONE else unknown


def _changed(cells: Cells, name: str) -> Any:
    return getattr(cells.layout.change(first(cells, "condition")), name)


def _one_line(text: object) -> str:
    return " ".join(str(text).split())


@column(CELL, is_of_study=True, table=first)
def study(row: Row, layout: Layout) -> str:
    """File name of the config without its ending; of scored folders, the folder of the report."""
    return layout.study


@column(CELL, is_of_study=True, table=first)
def measure(row: Row, layout: Layout) -> str:
    """What was scored: `picture` (captures against targets), `prediction` and `error_budget` (predictions against
    captures), `focus` (planes of focal stacks), `files` (pictures that were given)."""
    return layout.measure


@column(CELL, table=first)
def display(record: Record, layout: Layout) -> str:
    """Name of the display: a profile, a bench, or a trained network. Rows of the floor have the display whose scored
    region they share."""
    return str(record["cell"].get("profile") or record["cell"]["condition"])


@column(CELL, table=first)
def condition(record: Record, layout: Layout) -> str:
    """The display with what was changed on it, as report.md names it: the key that joins the three files. `reference`
    for rows of the floor."""
    return str(record["cell"]["condition"])


@column(CELL, table=first)
def method(record: Record, layout: Layout) -> str:
    """Name of the method in configs."""
    return str(record["cell"]["method"])


@column(CELL, table=first)
def label(record: Record, layout: Layout) -> str:
    """Name of the row in tables: a method with its parameters."""
    return str(record["label"])


@column(CELL, table=first)
def category(record: Record, layout: Layout) -> str:
    """What the method knows of the display: `open loop`, `calibrated`, `online` (captures the scored image), `oracle`,
    `given` (pictures from files); `floor`: an image that no method made."""
    return FLOOR if is_reference(record["cell"]["condition"]) else layout.category(record["label"])


@column(CELL, "count", is_of_study=True)
def capture_limit(row: Row, layout: Layout) -> float:
    """The most captures that the display allowed for a target; empty for no limit."""
    return layout.capture_limits.get(row["label"], np.nan)


@column(CELL, "count", is_of_study=True)
def panel_height_px(row: Row, layout: Layout) -> float:
    """Rows of the panel."""
    return layout.panels.get(row["display"], (np.nan, np.nan))[0]


@column(CELL, "count", is_of_study=True)
def panel_width_px(row: Row, layout: Layout) -> float:
    """Columns of the panel."""
    return layout.panels.get(row["display"], (np.nan, np.nan))[1]


@column(CELL, source=None)
def parameters(cells: Cells, name: str) -> str:
    """Parameters of the method as JSON, defaults filled in."""
    return json.dumps(cells.layout.params.get(first(cells, "label"), {}), sort_keys=True, ensure_ascii=False)


_SWEPT = (
    "What was changed after the display was calibrated, if anything, as the config names it; `plane` in focal stacks"
)


@column(CELL, is_of_study=True, table=_changed, meaning=_SWEPT)
def swept(row: Row, layout: Layout) -> str:
    """The kind of a change."""
    return layout.change(row["condition"], row["target"]).swept


@column(CELL, "number", is_of_study=True, table=_changed, unit="that of `swept_unit`")
def swept_value(row: Row, layout: Layout) -> float:
    """The change as a number; empty where the values are names."""
    return layout.change(row["condition"], row["target"]).swept_value


@column(CELL, is_of_study=True, table=_changed)
def swept_unit(row: Row, layout: Layout) -> str:
    """Unit of `swept_value`; `1` for a ratio, empty for the number of a draw or a panel."""
    return layout.change(row["condition"], row["target"]).swept_unit


@column(CELL, is_of_study=True, table=_changed)
def swept_name(row: Row, layout: Layout) -> str:
    """The change where its values are names, such as a prescription."""
    return layout.change(row["condition"], row["target"]).swept_name


@column(CELL)
def target(record: Record, layout: Layout) -> str:
    """Name of the image."""
    return str(record["cell"]["target"])


@column(CELL)
def cluster(record: Record, layout: Layout) -> str:
    """What the target shares with others, such as the photograph of a crop; else the target itself."""
    return layout.clusters.get(record["cell"]["target"], record["cell"]["target"])


@column(CELL, "count")
def repeat(record: Record, layout: Layout) -> int:
    """Number of the measurement, from 0; repeats differ by their noise."""
    return int(record["cell"].get("repeat", 0))


@column(CELL, "count", is_of_study=True)
def seed(row: Row, layout: Layout) -> int:
    """Seed of the study."""
    return layout.seed


@column(CELL)
def state(record: Record, layout: Layout) -> str:
    """`done`, `failed`, `skipped`, `unavailable` or `missing`."""
    return str(record["state"])


@column(CELL)
def reason(record: Record, layout: Layout) -> str:
    """Why a cell has no score."""
    return _one_line(record.get("reason", ""))


@column(CELL, "count", source=None)
def n(cells: Cells, name: str) -> int:
    """Targets with a score."""
    return int(cells.done["target"].nunique())


@column(CELL, "count", source=None)
def failed(cells: Cells, name: str) -> int:
    """Cells without a score."""
    return len(cells.cells) - len(cells.done)


@column(CELL, "count", source=None)
def clusters(cells: Cells, name: str) -> int:
    """Clusters of the targets with a score."""
    return int(cells.done["cluster"].nunique())


_CAPTURES = "Captures while solving, mean over cells"
_SOLVING = "Time to solve a target, median over the cells timed alone, or over all"
_PROCESSORS = "Time of all processors that solving took, median over cells"
_TRAINING = "Captures of the training, once for all targets"
_SECONDS = "Time of the training"
_LEARNED = "Digests of what was learned, with spaces between them"


@column(FIGURES, "count", table=mean, table_meaning=_CAPTURES, heading="captures per {each}")
def captures(record: Record, layout: Layout) -> int | None:
    """Captures that the method took while it solved the target, those of attempts that failed included."""
    return None if layout.measure == FILES else record.get("captures")  # of somebody else, it is not known


@column(FIGURES, "number", table=_median_alone, table_meaning=_SOLVING, heading="seconds per {each}")
def solving_s(record: Record, layout: Layout) -> float | None:
    """Time to solve the target, of the solving that made the phase, in this run or an earlier one."""
    return record.get("seconds")


def _if_several(frame: pd.DataFrame, name: str, layout: Layout) -> bool:
    return bool((frame["frames"] > 1).any())


@column(FIGURES, "count", kept=_if_several, table=mean, heading="frames of a hologram")
def frames(record: Record, layout: Layout) -> int:
    """Frames of the hologram, which share one exposure."""
    return int(record.get("frames", 1))


@column(FIGURES, "count", unit="frames", kept=_if_several, table=mean, heading="panel time [frames]")
def panel_time(record: Record, layout: Layout) -> int | None:
    """Frames shown for the picture, in the captures of solving and in the one that is scored."""
    taken, own, shown = record.get("captures"), int(record.get("frames", 1)), record.get("shown")
    return None if taken is None else own + (own * taken if shown is None else shown)


@column(FIGURES, "number")
def registration_residual_px(record: Record, layout: Layout) -> float | None:
    """Rms residual of registration, in pixels of the scored region."""
    return record.get("registration_residual_px")


@column(FIGURES, "number")
def saturated(record: Record, layout: Layout) -> float | None:
    """Share of the capture's samples at full scale."""
    return record.get("saturated")


@column(FIGURES, "number", kept=if_known)
def memory_mib(record: Record, layout: Layout) -> float | None:
    """Most memory that solving took beyond what was in use before."""
    return record.get("memory_mib")


@column(
    FIGURES, "number", kept=if_known, table=median, table_meaning=_PROCESSORS, heading="processor seconds per {each}"
)
def cpu_s(record: Record, layout: Layout) -> float | None:
    """Time of all processors that solving took, on one or more cores."""
    return record.get("cpu_s")


@column(FIGURES, "count", kept=if_known)
def timed_alone(record: Record, layout: Layout) -> bool | None:
    """1 where nothing else was at work beside the solution, else 0."""
    return record.get("alone")


@column(FIGURES, "count", kept=if_trained, table=mean, table_meaning=_TRAINING, heading="captures for training")
def training_captures(record: Record, layout: Layout) -> int | None:
    """Captures that the method's training took, once for all targets."""
    return _learned(record, "captures", 0, None)


@column(FIGURES, "number", kept=if_trained, table=mean, table_meaning=_SECONDS, heading="seconds of training")
def training_s(record: Record, layout: Layout) -> float | None:
    """Time that the training took."""
    return _learned(record, "seconds", 0, None)


@column(FIGURES, kept=if_trained, table=_together, table_meaning=_LEARNED)
def learned_sha256(record: Record, layout: Layout) -> str:
    """Digest of what was learned; empty for untrained methods."""
    return str(_learned(record, "sha256", "", ""))


_MEMORY = "Memory of solving, median over cells"  # a method's first solution also loads libraries
FIGURES.append(Column("memory_mib", _MEMORY, "number", "MiB", table=median, heading="memory [MiB]"))


@column(FIGURES, "number", source=None, heading="captures in total")
def total_captures(cells: Cells, name: str) -> float:
    """All captures behind the row: of the training, and of every target."""
    taken = cells.cells.dropna(subset="captures")  # failed cells have taken theirs, too
    if taken.empty:
        return float("nan")
    trained = taken["training_captures"].mean() if "training_captures" in taken else 0.0
    known = taken.assign(done=taken["state"] == DONE).groupby(["target", "done"], sort=False)["captures"].mean()
    return float(trained + known.groupby("target").max().sum())  # repeats: averaged, of failed ones apart


@column(FIGURES, "count", source=None)
def rank(cells: Cells, name: str) -> float:
    """Place by the mean headline score among the rows of its display and category."""
    return float("nan")  # known once all rows are


@column(FIGURES, kept=if_known)
def stop_reason(record: Record, layout: Layout) -> str:
    """Why the display ended the method before it was done."""
    return _one_line(record.get("stopped", ""))


@column(FIGURES, kept=if_known)
def phase_remark(record: Record, layout: Layout) -> str:
    """What is odd about the phase of a file or of a method of your own, on the nominal model."""
    return _one_line(record.get("remark", ""))


@column(FIGURES, kept=if_known)
def fell_back(record: Record, layout: Layout) -> str:
    """`yes` where a trained method fell back to Wirtinger holography, else empty."""
    return "yes" if (record.get("learned") or {}).get("fell_back") else ""


@column(FIGURES)
def cell(record: Record, layout: Layout) -> str:
    """Name of the capture: the digest of all that it depends on."""
    return str(record["id"])


@column(FIGURES)
def exposure(record: Record, layout: Layout) -> str:
    """`equal` light for all methods, or `matched` brightness."""
    return str(record["cell"].get("exposure", ""))


@column(FIGURES)
def display_version(record: Record, layout: Layout) -> str:
    """Version of the profile."""
    return str(record["cell"].get("profile_version", ""))


@column(FIGURES)
def protocol(record: Record, layout: Layout) -> str:
    """Version of the metric protocol."""
    return str(record["cell"].get("protocol", ""))


def recorded() -> list[Column]:
    """The columns of records.csv, in their order and without the scores."""
    return [column for column in (*CELL, *FIGURES) if column.source]


def tabled() -> list[Column]:
    """The columns of table.csv without the scores, with what they mean there."""
    listed = [column for column in (*CELL, *FIGURES) if column.table]
    told = [replace(column, meaning=column.table_meaning or column.meaning) for column in listed]
    return [replace(column, kind="number") if column.table is mean else column for column in told]


def costs(table: pd.DataFrame, each: str) -> dict[str, str]:
    """Headings of the known figures of a table that have one. each: what a method makes for a target."""
    headed = [column for column in FIGURES if column.heading and column.name in table]
    return {column.name: column.heading.format(each=each) for column in headed if table[column.name].notna().any()}
