"""The records frame, a row a cell, and the table, a row per method and condition, computed from the former alone.

Frames have the names of this module; files have those of ``columns``, and further columns from the study (``files``).
Numbers are rounded to six significant digits once, when records become a frame; everything after is computed from the
rounded numbers. So table.csv computed from a records.csv that was read back has the same bytes.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from ...core.errors import UserError
from ...core.hashing import digest
from ...study.plan import FLOORS, REFERENCE
from .categories import FLOOR, ORACLE
from .columns import file_name, frame_name
from .layout import Layout
from .scores import order_scores, parse
from .statistics import mean_interval
from .text import FILES

TEXT_COLUMNS = ("method", "name", "condition", "target", "state", "reason")
LEARNED_COLUMN = "learned_sha256"
SECONDS_COLUMN = "training_seconds"
TRAINING_COLUMNS = ("training_captures", SECONDS_COLUMN, LEARNED_COLUMN)  # of studies that train a method
MEMORY_COLUMN = "memory_mib"  # of studies that measured the memory of a solution
STOPPED_COLUMN = "stopped"  # of studies in which the display stopped a method
FELL_BACK_COLUMN = "fell_back"  # of studies in which a trained method fell back to Wirtinger holography
NOTE_COLUMNS = (STOPPED_COLUMN, FELL_BACK_COLUMN)
# Reports of earlier versions lack these two, and the columns that are computed from them. Alone: 1 where nothing else
# was at work beside a solution, else 0.
ALONE_COLUMN = "timed_alone"
CATEGORY_COLUMN = "track"
CLUSTER_COLUMN = "cluster"  # of studies whose targets come in clusters; else each target is one
MEASURED_COLUMNS = ("captures", "seconds", "registration_residual_px", "saturated")
IDENTITY_COLUMNS = ("cell", "exposure", "profile", "profile_version", "protocol")

_NUMBER_COLUMNS = ("repeat", *MEASURED_COLUMNS)
_REQUIRED = frozenset((*TEXT_COLUMNS, *_NUMBER_COLUMNS, *IDENTITY_COLUMNS))
# Columns of records.csv that say what the study's config says, too; frames do without them. Earlier versions wrote the
# parameters here, which stand in table.csv.
STUDY_COLUMNS = (
    *("study", "measure", "parameters", "capture_limit", "panel_height_px", "panel_width_px"),
    *("swept", "swept_value", "swept_unit", "swept_name", "seed"),
)
_NOT_SCORES = _REQUIRED | {
    *STUDY_COLUMNS,
    *TRAINING_COLUMNS,
    MEMORY_COLUMN,
    ALONE_COLUMN,
    *NOTE_COLUMNS,
    CATEGORY_COLUMN,
    CLUSTER_COLUMN,
}
DONE = "done"
MEDIAN = "_median"  # of the headline, after its name
# Text that a spreadsheet would run as a formula, after any apostrophes, which this module puts before it.
_FORMULA = re.compile(r"'*\s*[=+\-@＝＋－＠]")


def format_number(value: float) -> str:
    """Six significant digits; empty for NaN."""
    return "" if np.isnan(value) else f"{value:.6g}"


def _rounded(value: Any) -> float:
    return float("nan") if value is None else float(f"{float(value):.6g}")


def _row(record: Mapping[str, Any], identity: str, layout: Layout) -> dict[str, Any]:
    cell = record["cell"]
    text = {
        "method": record["label"],
        "name": cell["method"],
        "condition": cell["condition"],
        "target": cell["target"],
        CLUSTER_COLUMN: layout.clusters.get(cell["target"], cell["target"]),
        "state": record["state"],
        "reason": _one_line(record.get("reason", "")),
        STOPPED_COLUMN: _one_line(record.get("stopped", "")),
        FELL_BACK_COLUMN: "yes" if (record.get("learned") or {}).get("fell_back") else "",
        CATEGORY_COLUMN: "" if cell["condition"] == REFERENCE else layout.category(record["label"]),
        "cell": identity,
        **{key: cell.get(key, "") for key in IDENTITY_COLUMNS[1:]},
    }
    scores = record.get("scores", {}) if record["state"] == DONE else {}
    numbers = {
        "repeat": cell.get("repeat", 0),
        **{key: record.get(key) for key in (*MEASURED_COLUMNS, MEMORY_COLUMN)},
        ALONE_COLUMN: record.get("alone"),
        **({"captures": None} if layout.measure == FILES else {}),  # how many somebody else took is not known
        **scores,
    }
    clash = set(scores) & _NOT_SCORES
    if clash:
        raise UserError(f"record {identity}: score named like a column of records.csv: {', '.join(sorted(clash))}")
    row = {key: str(value) for key, value in text.items()} | {key: _rounded(value) for key, value in numbers.items()}
    return row | _training(record)


def _one_line(text: object) -> str:
    return " ".join(str(text).split())


def _training(record: Mapping[str, Any]) -> dict[str, Any]:
    """What the training behind a score took: nothing for a method that is not trained, unknown without a score."""
    if record["state"] != DONE:
        return {"training_captures": float("nan"), "training_seconds": float("nan"), LEARNED_COLUMN: ""}
    learned = record.get("learned") or {}
    counts = {f"training_{key}": _rounded(learned.get(key, 0)) for key in ("captures", "seconds")}
    return counts | {LEARNED_COLUMN: str(learned.get("sha256", ""))}


def records_frame(records: Iterable[Mapping[str, Any]], layout: Layout) -> pd.DataFrame:
    """A row a cell, in an order that does not depend on the order of the records.

    records: as ``study.store.Store.load`` gives them, one for every planned cell, those without a score included.
    """
    rows = [_row(record, digest(record["cell"]), layout) for record in records]
    frame = pd.DataFrame(rows)
    # Without any score the headline still has its column, empty, so that the holes have a table to show in.
    scores = order_scores(column for column in frame.columns if column not in _NOT_SCORES) or [layout.headline]
    untrained = () if layout.trained else TRAINING_COLUMNS
    unknown = [column for column in (MEMORY_COLUMN, ALONE_COLUMN) if frame[column].isna().all()]
    silent = [column for column in NOTE_COLUMNS if not frame[column].any()]
    left = frame.columns.drop([*untrained, *unknown, *silent, *_single(frame)])
    return _sorted(frame.reindex(columns=_ordered(left, scores)), layout)


def _ordered(columns: Iterable[str], scores: Sequence[str]) -> list[str]:
    """Those of the columns of a records frame that there are, and its scores, in their order."""
    present = set(columns)
    before = ("method", "name", "condition", "target", CLUSTER_COLUMN, "repeat", "state", "reason")
    measured = (*MEASURED_COLUMNS, MEMORY_COLUMN, ALONE_COLUMN, *TRAINING_COLUMNS, *NOTE_COLUMNS, CATEGORY_COLUMN)
    first, last = ([name for name in names if name in present] for names in (before, (*measured, *IDENTITY_COLUMNS)))
    return [*first, *scores, *last]


def _single(frame: pd.DataFrame) -> list[str]:
    """The column of clusters where each target is its own, which frames do without."""
    return [CLUSTER_COLUMN] if (frame[CLUSTER_COLUMN] == frame["target"]).all() else []


def row_order(frame: pd.DataFrame, layout: Layout) -> list[tuple[str, str]]:
    """(method, condition) of every row: planned pairs, pairs outside the plan by name, then the reference rows."""
    pairs = set(zip(frame["method"], frame["condition"], strict=True))
    floors = [(name, REFERENCE) for name in FLOORS if (name, REFERENCE) in pairs]
    extra = sorted(pairs - set(layout.pairs) - set(floors))
    return [*(pair for pair in layout.pairs if pair in pairs), *extra, *floors]


def _sorted(frame: pd.DataFrame, layout: Layout) -> pd.DataFrame:
    rank = {pair: index for index, pair in enumerate(row_order(frame, layout))}
    target_rank = {target: index for index, target in enumerate(layout.targets)}
    pairs = zip(frame["method"], frame["condition"], strict=True)
    ordered = frame.assign(
        _row=[rank[pair] for pair in pairs],
        _target=[target_rank.get(target, len(target_rank)) for target in frame["target"]],
    )
    ordered = ordered.sort_values(["_row", "_target", "target", "repeat", "cell"], kind="stable")
    return ordered.drop(columns=["_row", "_target"]).reset_index(drop=True)


def score_columns(frame: pd.DataFrame) -> list[str]:
    """The score columns of a records frame, in their order."""
    return [str(column) for column in frame.columns if column not in _NOT_SCORES]


def per_target(rows: pd.DataFrame) -> pd.DataFrame:
    """Every number of the done cells in ``rows``, a row a target in the order of the rows, repeats averaged."""
    done = rows[rows["state"] == DONE]
    return done.groupby("target", sort=False).mean(numeric_only=True)


def clusters_in(frame: pd.DataFrame) -> dict[str, str]:
    """The cluster of every target of a records frame; empty where each is its own."""
    return dict(zip(frame["target"], frame[CLUSTER_COLUMN], strict=True)) if CLUSTER_COLUMN in frame else {}


def table_from_records(frame: pd.DataFrame, layout: Layout) -> pd.DataFrame:
    """A row per method and condition: means over targets with 95 % intervals over their clusters.

    ``n`` counts targets with at least one done cell, ``clusters`` their clusters where targets come in such, and
    ``failed`` counts cells without a score. The headline has a median over targets, too. A metric that only
    some of the ``n`` targets have is left empty, so that its mean always stands for the ``n`` beside it; figures that
    describe the capture, such as the speckle contrast of flat patches, are means over the targets that have them.
    """
    groups = dict(list(frame.groupby(["method", "condition"], sort=False)))
    scores = score_columns(frame)
    rows = [_table_row(groups[pair], pair, scores, layout) for pair in row_order(frame, layout)]
    table = pd.DataFrame(rows)
    targets = len({*layout.targets, *frame["target"]})
    return _ranked(table, targets, layout) if CATEGORY_COLUMN in table else table


def _table_row(rows: pd.DataFrame, pair: tuple[str, str], scores: Sequence[str], layout: Layout) -> dict[str, Any]:
    label, condition = pair
    done = rows[rows["state"] == DONE]
    n = done["target"].nunique()
    row: dict[str, Any] = {"method": label, "condition": condition, "n": n, "failed": len(rows) - len(done)}
    known = clusters_in(done)
    row |= {"clusters": len(set(known.values()))} if CLUSTER_COLUMN in rows else {}
    means = per_target(rows)
    for score in scores:
        values = means[score].dropna()
        if values.size != n and parse(score).domain:
            values = values[:0]
        estimate = mean_interval(values.to_numpy(), [known.get(str(target), str(target)) for target in values.index])
        row |= {score: estimate.mean, f"{score}_lo": estimate.low, f"{score}_hi": estimate.high}
        row |= {f"{score}{MEDIAN}": values.median()} if score == layout.headline else {}
    row |= {"captures": done["captures"].mean(), "seconds": timed(done)["seconds"].mean()}
    if LEARNED_COLUMN in done:
        row |= {key: done[key].mean() for key in TRAINING_COLUMNS if key != LEARNED_COLUMN}
        row[LEARNED_COLUMN] = " ".join(sorted(set(done[LEARNED_COLUMN]) - {""}))
    if MEMORY_COLUMN in done:
        row[MEMORY_COLUMN] = done[MEMORY_COLUMN].median()  # a method's first solution also loads libraries
    if CATEGORY_COLUMN in rows:
        row |= {"total_captures": total_captures(done), CATEGORY_COLUMN: rows[CATEGORY_COLUMN].iloc[0], "rank": np.nan}
    published = layout.published(label, condition)
    return row | {f"reported_{name}": published.get(name, np.nan) for name in layout.reported_metrics}


def timed(done: pd.DataFrame) -> pd.DataFrame:
    """Of the done cells of a row those whose seconds count: what was solved alone if anything was, else all."""
    alone = done[done[ALONE_COLUMN] == 1] if ALONE_COLUMN in done else done
    return done if alone.empty else alone


def total_captures(done: pd.DataFrame) -> float:
    """Every capture behind the done cells of a row: those of the training once, and those of every target.

    Repeats are averaged within a target, since only the measurement is repeated. NaN for no cells, and where no number
    of captures is known.
    """
    if done.empty or done["captures"].isna().all():
        return float("nan")
    trained = done["training_captures"].mean() if LEARNED_COLUMN in done else 0.0
    return float(trained + done.groupby("target", sort=False)["captures"].mean().sum())


def _ranked(table: pd.DataFrame, targets: int, layout: Layout) -> pd.DataFrame:
    """The table with the place of every row among those of its display and category, by its mean headline score.

    Only rows with every target are ranked, and neither oracle nor floor; equal means share the better place.
    """
    score = parse(layout.headline)
    if score.key in table:
        ranked = (table["n"] == targets) & table[score.key].notna() & ~table[CATEGORY_COLUMN].isin(("", ORACLE))
        groups = table[ranked].groupby(["condition", CATEGORY_COLUMN])[score.key]
        table.loc[ranked, "rank"] = groups.rank(method="min", ascending=not score.higher_is_better)
    return table


def csv_text(frame: pd.DataFrame) -> str:
    """The frame as CSV with fixed formatting: the same numbers give the same bytes.

    Text that a spreadsheet would take for a formula has an apostrophe before it, which :func:`read_records` takes off.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(map(_cell, frame.columns))
    for row in frame.itertuples(index=False):
        writer.writerow(map(_cell, row))
    return text.getvalue()


def _cell(value: Any) -> str:
    if isinstance(value, str):
        return f"'{value}" if _FORMULA.match(value) else value
    return str(value) if isinstance(value, int | np.integer) else format_number(value)


def read_records(text: str) -> pd.DataFrame:
    """The records frame from the text of records.csv, of this version or with the columns of frames, as it once had."""
    frame = pd.read_csv(io.StringIO(text), dtype=str, keep_default_na=False)
    frame = frame.replace(f"^'({_FORMULA.pattern})", r"\1", regex=True)
    written: Callable[[str], str] = str  # the name that a column has in the file
    if "label" in frame:
        frame, written = _translated(frame), file_name
    lacking = _REQUIRED - set(frame.columns)
    if lacking:
        raise UserError(
            f"records.csv lacks the columns {', '.join(sorted(map(written, lacking)))}; "
            "it was written by another version"
        )
    text_columns = {*TEXT_COLUMNS, *IDENTITY_COLUMNS, LEARNED_COLUMN, *NOTE_COLUMNS, CATEGORY_COLUMN, CLUSTER_COLUMN}
    for column in frame.columns:
        if column not in text_columns:
            try:
                frame[column] = [float(value) if value else np.nan for value in frame[column]]
            except ValueError as error:
                raise UserError(f"records.csv, column {written(column)}: {error}") from error
    return frame


def _translated(frame: pd.DataFrame) -> pd.DataFrame:
    """A frame of text with the columns of records.csv as one with those of frames."""
    frame = frame.drop(columns=list(STUDY_COLUMNS), errors="ignore").rename(columns=frame_name)
    if CATEGORY_COLUMN in frame:
        frame[CATEGORY_COLUMN] = frame[CATEGORY_COLUMN].replace(FLOOR, "")
    if {"profile", "profile_version"} <= set(frame.columns):  # pictures from files have no profile
        frame["profile"] = frame["profile"].where(frame["profile_version"] != "", "")
    if {CLUSTER_COLUMN, "target"} <= set(frame.columns):
        frame = frame.drop(columns=_single(frame))
    return frame[_ordered(frame.columns, score_columns(frame))]
