"""The frame of records.csv, a row a cell, and that of table.csv, a row per method and condition, from the former alone.

Frames have the columns of ``columns``. Numbers are rounded to six significant digits once, when records become a frame;
everything after is computed from the rounded numbers. So table.csv computed from a records.csv that was read back has
the same bytes.
"""

from __future__ import annotations

import io
import math
import re
from collections.abc import Container, Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from ...core.errors import UserError
from ...core.io import CONTROLS, read_text
from ...study.plan import FLOORS, Plan, is_reference
from . import columns
from .column import DONE as DONE
from .column import Cells, Column, Record
from .layout import FLOOR, ORACLE, Layout
from .scores import order_scores, parse
from .statistics import mean_interval

PUBLISHED = "reported_"  # how columns of published figures begin
MOST_BYTES = 64_000_000  # of a file of numbers of one study
MEDIAN = "_median"  # the statistic of the headline beside its mean
_EXACT = 2.0**53  # below it every whole number is a float
# Text that a spreadsheet would run as a formula, after any apostrophes, which this module puts before it.
_FORMULA = re.compile(r"'*\s*[=+\-@＝＋－＠]")
GUARDED = rf"^'({_FORMULA.pattern})"


def rounded(value: Any) -> float:
    """The number as the CSV files have it, with six significant digits; NaN for None."""
    return float("nan") if value is None else float(f"{float(value):.6g}")


def to_json(value: float | None) -> float | None:
    """The number as JSON files have it; None for NaN, which JSON has not."""
    return None if value is None or math.isnan(value) else rounded(value)


def _row(record: Record, layout: Layout, listed: Sequence[Column]) -> dict[str, Any]:
    """A row from its record, or as it was written where the record is one of ``committed_records``."""
    if "row" in record:
        return dict(record["row"])
    row = {
        column.name: (str if column.kind == "text" else rounded)(column.source(record, layout))
        for column in listed
        if column.source and not column.is_of_study
    }
    scores = record.get("scores", {}) if record["state"] == DONE else {}
    found = {parse(key).column: rounded(value) for key, value in scores.items()}
    if clash := [column.name for column in listed if column.name in found]:
        raise UserError(f"record {row['cell']}: score named like a column of records.csv: {', '.join(clash)}")
    return row | found


def records_frame(records: Iterable[Record], layout: Layout) -> pd.DataFrame:
    """The frame of records.csv, a row a cell, in an order that does not depend on the order of the records.

    records: as ``study.store.Store.load`` gives them, one for every planned cell, those without a score included.
    """
    listed = columns.recorded()
    frame = of_study(pd.DataFrame([_row(record, layout, listed) for record in records]), layout)
    # Without any score the headline still has its column, empty, so that the holes have a table to show in.
    scores = order_scores(score_columns(frame)) or [parse(layout.headline).column]
    kept = [
        column
        for column in listed
        if column.name in frame and (column.kept is None or column.kept(frame, column.name, layout))
    ]
    first, last = ([column.name for column in part if column in kept] for part in (columns.CELL, columns.FIGURES))
    return _sorted(_whole(frame.reindex(columns=[*first, *scores, *last])), layout)


def of_study(frame: pd.DataFrame, layout: Layout) -> pd.DataFrame:
    """A records frame with the columns that follow from the config of its study."""
    rows = frame[["label", "display", "condition", "target"]].to_dict("records")
    sources = {column.name: column.source for column in columns.recorded() if column.is_of_study}
    return frame.assign(**{name: [source(row, layout) for row in rows] for name, source in sources.items() if source})


def _whole(frame: pd.DataFrame) -> pd.DataFrame:
    """The frame with integers in columns of counts that have no holes."""
    counts = [column.name for column in columns.recorded() if column.kind == "count" and column.name in frame]
    known = [name for name in counts if ((frame[name] % 1 == 0) & (frame[name].abs() < _EXACT)).all()]
    return frame.astype(dict.fromkeys(known, np.int64))


def row_order(frame: pd.DataFrame, layout: Layout) -> list[tuple[str, str]]:
    """(label, condition) of every row: planned pairs, pairs outside the plan by name, then the reference rows."""
    pairs = set(zip(frame["label"], frame["condition"], strict=True))
    references = sorted({condition for _, condition in pairs if is_reference(condition)})
    floors = [(name, condition) for condition in references for name in FLOORS if (name, condition) in pairs]
    extra = sorted(pairs - set(layout.pairs) - set(floors))
    return [*(pair for pair in layout.pairs if pair in pairs), *extra, *floors]


def _sorted(frame: pd.DataFrame, layout: Layout) -> pd.DataFrame:
    rank = {pair: index for index, pair in enumerate(row_order(frame, layout))}
    targets = {target: index for index, target in enumerate(layout.targets)}  # all others come last, by name
    pairs = zip(frame["label"], frame["condition"], strict=True)
    places = frame.assign(_row=[rank[pair] for pair in pairs], _target=frame["target"].map(targets))
    ordered = places.sort_values(["_row", "_target", "target", "repeat", "cell"], kind="stable")
    return ordered.drop(columns=["_row", "_target"]).reset_index(drop=True)


def score_columns(frame: pd.DataFrame) -> list[str]:
    """The score columns of a records frame, in their order."""
    others = {column.name for column in columns.recorded()}
    return [str(name) for name in frame.columns if name not in others]


def per_target(frame: pd.DataFrame) -> dict[tuple[str, str], pd.DataFrame]:
    """By (label, condition), every number of the done cells: a row a target in the order of the frame, repeats
    averaged."""
    done = frame[frame["state"] == DONE]
    means = done.groupby(["label", "condition", "target"], sort=False).mean(numeric_only=True)
    groups = means.groupby(level=["label", "condition"], sort=False)
    return {(str(label), str(name)): rows.droplevel([0, 1]) for (label, name), rows in groups}


def clusters_in(frame: pd.DataFrame) -> dict[str, str]:
    """The cluster of every target of a records frame."""
    return dict(zip(frame["target"], frame["cluster"], strict=True))


def table_from_records(frame: pd.DataFrame, layout: Layout) -> pd.DataFrame:
    """The frame of table.csv, a row per method and condition: means over targets with 95 % intervals over clusters.

    ``n`` counts targets with at least one done cell, ``clusters`` their clusters, and ``failed`` counts cells without a
    score. The headline has a median over targets, too. A metric that only some of the ``n`` targets have is left empty,
    so that its mean always stands for the ``n`` beside it; figures that describe the capture, such as the speckle
    contrast of flat patches, are means over the targets that have them.
    """
    groups, unknown = frame.groupby(["label", "condition"]), {column.name for column in columns.recorded()} - set(frame)
    means, none = per_target(frame), frame[score_columns(frame)].iloc[:0]
    rows = []
    for pair in row_order(frame, layout):
        cells, published = Cells(groups.get_group(pair), layout), layout.published(*pair)
        first, last = (_values(cells, part, unknown) for part in (columns.CELL, columns.FIGURES))
        scores = _statistics(cells, means.get(pair, none))
        reported = {f"{PUBLISHED}{parse(name).column}": published.get(name, np.nan) for name in layout.reported_metrics}
        rows.append(first | scores | last | reported)
    return _ranked(pd.DataFrame(rows), len({*layout.targets, *frame["target"]}), layout)


def _values(cells: Cells, listed: Sequence[Column], unknown: Container[str]) -> dict[str, Any]:
    known = [column for column in listed if column.name not in unknown]
    return {column.name: column.table(cells, column.name) for column in known if column.table}


def _statistics(cells: Cells, means: pd.DataFrame) -> dict[str, float]:
    """Mean of every score with its interval. means: of ``per_target``."""
    found: dict[str, float] = {}
    known = clusters_in(cells.done)
    clusters = np.array([known[target] for target in means.index])
    for score in map(parse, score_columns(cells.cells)):
        values = means[score.column].to_numpy()
        held = ~np.isnan(values)
        if score.domain and not held.all():
            held[:] = False
        estimate = mean_interval(values[held], clusters[held])
        found |= dict(zip(score.columns, (estimate.mean, estimate.low, estimate.high), strict=True))
        if score.key == cells.layout.headline:
            found[score.statistic(MEDIAN)] = float(np.median(values[held])) if held.any() else np.nan
    return found


def _ranked(table: pd.DataFrame, targets: int, layout: Layout) -> pd.DataFrame:
    """The table with the place of every row among those of its display and category, by its mean headline score.

    Only rows with every target are ranked, and neither oracle nor floor; equal means share the better place.
    """
    score = parse(layout.headline)
    if score.column in table:
        ranked = (table["n"] == targets) & table[score.column].notna() & ~table["category"].isin((FLOOR, ORACLE))
        groups = table[ranked].groupby(["condition", "category"])[score.column]
        table.loc[ranked, "rank"] = groups.rank(method="min", ascending=not score.higher_is_better)
    return table


def csv_text(frame: pd.DataFrame) -> str:
    """The frame as CSV with fixed formatting: the same numbers give the same bytes.

    Text that a spreadsheet would take for a formula has an apostrophe before it, which :func:`read_records` takes off.
    """
    guarded = frame.rename(columns=_guarded).map(_guarded)
    return str(guarded.to_csv(index=False, float_format="%.6g", lineterminator="\n"))


def _guarded(value: Any) -> Any:
    return f"'{value}" if isinstance(value, str) and _FORMULA.match(value) else value


def records_text(path: Path) -> str:
    """The text of a records.csv. UserError: no regular file, too large for a study's, or not UTF-8."""
    return read_text(path, MOST_BYTES)


def read_records(text: str) -> pd.DataFrame:
    """The records frame from the text of records.csv. UserError: it is none, or a text would control a terminal."""
    frame = pd.read_csv(io.StringIO(text), dtype=str, keep_default_na=False)
    listed = columns.recorded()
    lacking = sorted(column.name for column in listed if column.kept is None and column.name not in frame)
    if lacking:
        raise UserError(f"records.csv lacks the columns {', '.join(lacking)}; it was written by another version")
    texts = [column.name for column in listed if column.kind == "text" and column.name in frame]
    for name in texts:
        if value := next((value for value in frame[name].unique() if CONTROLS.search(value.replace("\t", ""))), ""):
            raise UserError(f"records.csv, column {name}: {value[:60]!r} holds control characters; take them out")
    frame[texts] = frame[texts].replace(GUARDED, r"\1", regex=True)
    for name in frame.columns.drop(texts):
        try:
            frame[name] = [float(value) if value else np.nan for value in frame[name]]
        except ValueError as error:
            raise UserError(f"records.csv, column {name}: {error}") from error
    return _whole(frame)


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
    found = []
    for label, cell in plan.labelled():
        row = rows[cell.id]
        found.append(
            {
                "id": cell.id,
                "cell": {**cell.facts(), "protocol": row["protocol"]},  # of then, as its scores
                "label": label,
                "state": row["state"],
                "scores": {key: row[name] for key, name in scores.items() if not pd.isna(row[name])},
                "learned": {"sha256": row["learned_sha256"]} if row.get("learned_sha256") else None,
                "row": {**row, "label": label},  # what the numbers of the tables come from
            }
        )
    return found
