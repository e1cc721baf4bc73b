"""The numbers of a study: one frame of records, from which each file, page and chart takes what it shows.

Frames have the columns of ``columns``. Numbers are rounded to six significant digits once, when records become a frame;
all that comes after is computed from the rounded numbers. So table.csv computed from a records.csv that was read back
has the same bytes.
"""

from __future__ import annotations

import io
import json
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ..core.errors import UserError, one_line, suggest
from ..core.io import CONTROLS, read_text
from ..metrics import control
from ..study.definition import Study
from ..study.plan import FLOORS, REFERENCE, Plan, is_reference, reference_of
from .columns import AFTER, BEFORE, OF_STUDY, PUBLISHED, RECORDED, TESTED, Column
from .facts import FLOOR, OFFLINE, ORACLE, UNCHANGED, Facts
from .scores import Score, order_scores, parse
from .statistics import Array, Estimate, PairedTest, family_p, mean_interval
from .text import FILES, Text

Record = Mapping[str, Any]  # as ``study.store.Store.load`` gives it
DONE, CONSTANT = "done", "floor_constant"
DISTURBED = 1.3  # times the processor time: a solution that took longer waited for something else
MOST_BYTES = 64_000_000  # of a file of numbers of one study
# Metrics of the main table besides the headline.
LEADING = ("psnr", "ssim", "ms_ssim", "lpips_alex", "lpips_vgg", "mofd", control.NAME)
_EXACT = 2.0**53  # below it each whole number is a float
# Text that a spreadsheet would run as a formula, after any apostrophes, which `csv_text` puts before it.
_FORMULA = re.compile(r"'*\s*[=+\-@＝＋－＠]")


def rounded(value: Any) -> float:
    """The number as the CSV files have it, with six significant digits; NaN for None."""
    return math.nan if value is None else float(f"{float(value):.6g}")


def to_json(value: float | None) -> float | None:
    """The number as JSON files have it; None for NaN, which JSON has not."""
    return None if value is None or math.isnan(value) else rounded(value)


def records_frame(records: Iterable[Record], facts: Facts) -> pd.DataFrame:
    """The frame of records.csv, a row a cell, in an order that does not depend on the order of the records.

    records: as ``study.store.Store.load`` gives them, one for each planned cell, those without a score included.
    """
    frame = of_study(pd.DataFrame([_row(record, facts) for record in records]), facts)
    # Without any score the headline still has its column, empty, so that the holes have a table to show in.
    scores = order_scores(score_columns(frame)) or [parse(facts.study.headline).column]
    kept = {name for name, column in RECORDED.items() if name in frame and _is_kept(column, frame, facts)}
    first, last = (
        [column.name for column in part if column.source and column.name in kept] for part in (BEFORE, AFTER)
    )
    return _sorted(_whole(frame.reindex(columns=[*first, *scores, *last])), facts)


def _row(record: Record, facts: Facts) -> dict[str, Any]:
    """A row from its record, or as it was written where the record is one of ``committed_records``."""
    if "row" in record:
        return dict(record["row"])
    cell, learned, is_done = record["cell"], record.get("learned") or {}, record["state"] == DONE
    taken, own, seen = record.get("captures"), int(record.get("frames", 1)), record.get("shown")
    texts = {
        "display": cell.get("profile") or cell["condition"],
        "condition": cell["condition"],
        "method": cell["method"],
        "label": record["label"],
        "category": FLOOR if is_reference(cell["condition"]) else facts.category(record["label"]),
        "target": cell["target"],
        "cluster": facts.targets["cluster"].get(cell["target"], cell["target"]),
        "state": record["state"],
        "reason": _one_line(record.get("reason", "")),
        "learned_sha256": learned.get("sha256", "") if is_done else "",
        "stop_reason": _one_line(record.get("stopped", "")),
        "phase_remark": _one_line(record.get("remark", "")),
        "fell_back": "yes" if learned.get("fell_back") else "",
        "cell": record["id"],
        "exposure": cell.get("exposure", ""),
        "display_version": cell.get("profile_version", ""),
        "protocol": cell.get("protocol", ""),
    }
    numbers = {
        "repeat": cell.get("repeat", 0),
        "captures": None if facts.study.measure == FILES else taken,  # of somebody else, it is not known
        "solving_s": record.get("seconds"),
        "frames": own,
        "panel_time": None if taken is None else own + (own * taken if seen is None else seen),
        "registration_residual_px": record.get("registration_residual_px"),
        "saturated": record.get("saturated"),
        "memory_mib": record.get("memory_mib"),
        "cpu_s": record.get("cpu_s"),
        "timed_alone": record.get("alone"),
        "training_captures": learned.get("captures", 0) if is_done else None,
        "training_s": learned.get("seconds", 0) if is_done else None,
    }
    scores = record.get("scores", {}) if is_done else {}
    values = {parse(key).column: value for key, value in scores.items()}
    if clash := [name for name in RECORDED if name in values]:
        raise UserError(f"record {record['id']}: score named like a column of records.csv: {', '.join(clash)}")
    return texts | {name: rounded(value) for name, value in (numbers | values).items()}


def _one_line(text: str) -> str:
    return " ".join(text.split())


def _is_kept(column: Column, frame: pd.DataFrame, facts: Facts) -> bool:
    """Whether a frame keeps a column: of training where a method trains, of frames where there are several, others
    that no record needs to have where any has them."""
    if not column.source.endswith("?"):
        return True
    if column.name in ("training_captures", "training_s", "learned_sha256"):
        return bool(facts.labels("trained"))
    if column.name in ("frames", "panel_time"):
        return bool((frame["frames"] > 1).any())
    return bool((frame[column.name].notna() & (frame[column.name] != "")).any())


def of_study(frame: pd.DataFrame, facts: Facts) -> pd.DataFrame:
    """A records frame with the columns that follow from the config of its study."""
    cells = frame[["label", "display", "condition", "target"]].itertuples(index=False)
    return frame.assign(**pd.DataFrame([facts.row(*cell) for cell in cells], index=frame.index)[OF_STUDY])


def _whole(frame: pd.DataFrame) -> pd.DataFrame:
    """The frame with integers in columns of counts that have no holes."""
    counts = [name for name, column in RECORDED.items() if column.kind == "count" and name in frame]
    known = [name for name in counts if ((frame[name] % 1 == 0) & (frame[name].abs() < _EXACT)).all()]
    return frame.astype(dict.fromkeys(known, np.int64))


def _pairs(frame: pd.DataFrame, facts: Facts) -> list[tuple[str, str]]:
    """(label, condition) of each row: planned pairs, pairs outside the plan by name, then the reference rows."""
    pairs = set(zip(frame["label"], frame["condition"], strict=True))
    references = sorted({condition for _, condition in pairs if is_reference(condition)})
    floors = [(name, condition) for condition in references for name in FLOORS if (name, condition) in pairs]
    extra = sorted(pairs - set(facts.pairs) - set(floors))
    return [*(pair for pair in facts.pairs if pair in pairs), *extra, *floors]


def _sorted(frame: pd.DataFrame, facts: Facts) -> pd.DataFrame:
    rank = {pair: index for index, pair in enumerate(_pairs(frame, facts))}
    targets = {target: index for index, target in enumerate(facts.targets.index)}  # all others come last, by name
    pairs = zip(frame["label"], frame["condition"], strict=True)
    places = frame.assign(_row=[rank[pair] for pair in pairs], _target=frame["target"].map(targets))
    ordered = places.sort_values(["_row", "_target", "target", "repeat", "cell"], kind="stable")
    return ordered.drop(columns=["_row", "_target"]).reset_index(drop=True)


def clusters_in(frame: pd.DataFrame) -> dict[str, str]:
    """The cluster of each target of a records frame."""
    return dict(zip(frame["target"], frame["cluster"], strict=True))


def score_columns(frame: pd.DataFrame) -> list[str]:
    """The score columns of a records frame, in their order."""
    return [str(name) for name in frame.columns if name not in RECORDED]


def csv_text(frame: pd.DataFrame) -> str:
    """The frame as CSV with fixed formatting: the same numbers give the same bytes.

    Text that a spreadsheet would take for a formula has an apostrophe before it, which :func:`read_records` takes off.
    """

    def guarded(value: Any) -> Any:
        return f"'{value}" if isinstance(value, str) and _FORMULA.match(value) else value

    safe = frame.rename(columns=guarded).map(guarded)
    return str(safe.to_csv(index=False, float_format="%.6g", lineterminator="\n"))


def records_text(path: Path) -> str:
    """The text of a records.csv. UserError: no regular file, too large for a study's, or not UTF-8."""
    return read_text(path, MOST_BYTES)


def read_records(text: str) -> pd.DataFrame:
    """The records frame from the text of records.csv. UserError: it is none, or a text would control a terminal."""
    try:
        frame = pd.read_csv(io.StringIO(text), dtype=str, keep_default_na=False)
    except ValueError as error:  # pandas' own: empty, or of lines that do not fit
        raise UserError(f"records.csv: {one_line(str(error))}") from error
    lacking = sorted(name for name, column in RECORDED.items() if "?" not in column.source and name not in frame)
    if lacking:
        raise UserError(f"records.csv lacks the columns {', '.join(lacking)}; it was written by another version")
    texts = [name for name, column in RECORDED.items() if column.kind == "text" and name in frame]
    for name in texts:
        if value := next((value for value in frame[name].unique() if CONTROLS.search(value.replace("\t", ""))), ""):
            raise UserError(f"records.csv, column {name}: {value[:60]!r} holds control characters; take them out")
    frame[texts] = frame[texts].replace(rf"^'({_FORMULA.pattern})", r"\1", regex=True)
    for name in frame.columns.drop(texts):
        try:
            frame[name] = [float(value) if value else math.nan for value in frame[name]]
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
    """A record for each cell of a plan, as ``Store.load`` gives them under the plan's labels.

    frame: a records frame that has all of them, see ``difference``.
    """
    rows = {row["cell"]: row for row in frame.to_dict("records")}
    scores = {parse(name).key: name for name in score_columns(frame)}
    return [
        {
            "id": cell.id,
            "cell": {**cell.facts(), "protocol": row["protocol"]},  # of then, as its scores
            "label": label,
            "state": row["state"],
            "scores": {key: row[name] for key, name in scores.items() if not pd.isna(row[name])},
            "learned": {"sha256": row["learned_sha256"]} if row.get("learned_sha256") else None,
            "row": {**row, "label": label},  # what the numbers of the tables come from
        }
        for label, cell in plan.labelled()
        for row in (rows[cell.id],)
    ]


@dataclass(frozen=True)
class Results:
    """A records frame with the facts of its study, see ``records_frame``, and those of the parts that predict."""

    frame: pd.DataFrame
    facts: Facts
    related: Mapping[str, Results] = field(default_factory=dict)

    @property
    def study(self) -> Study:
        """The study as its config describes it."""
        return self.facts.study

    @property
    def baseline(self) -> str | None:
        """The label that each method is tested against; None where there are no such tests."""
        return self.study.baseline or None

    @property
    def text(self) -> Text:
        """What is compared, in words."""
        return self.facts.text

    def category(self, label: str) -> str:
        """The category that a method competes in."""
        return self.facts.category(label)

    @cached_property
    def labels(self) -> list[str]:
        """Labels of the planned methods, in the order of the config."""
        return list(dict.fromkeys(label for label, _ in self.facts.pairs))

    @cached_property
    def scores(self) -> list[Score]:
        """Every score of the records, in the order of the tables."""
        return [parse(name) for name in score_columns(self.frame)]

    @cached_property
    def headline(self) -> Score:
        """The headline metric. UserError when no record has it, though some were scored."""
        keys, wanted = [score.key for score in self.scores], self.study.headline
        if keys and wanted not in keys:
            plain = [score.key for score in self.scores if score.domain and not score.variant]
            raise UserError(f"headline '{wanted}' is in no record; {suggest(wanted, plain)}")
        return parse(wanted)

    @cached_property
    def leading(self) -> list[Score]:
        """The headline metric, those of what is in focus, then the usual ones in linear light, or their only domain."""
        plain = [score for score in self.scores if not score.variant]
        chosen = list(dict.fromkeys([self.headline, *(score for score in self.scores if score.in_focus)]))
        for metric in LEADING:
            same = sorted((s for s in plain if s.metric == metric), key=lambda s: s.domain not in ("linear", ""))
            if same and same[0] not in chosen and not (metric == "mofd" and any("lpips" in s.metric for s in chosen)):
                chosen.append(same[0])
        return chosen

    @cached_property
    def beside(self) -> list[Score]:
        """MS-SSIM and brightness ratio, for tables of PSNR, which rewards fog; none where no record has MS-SSIM."""
        keys = [score.key for score in self.scores]
        structure = f"ms_ssim_{self.headline.domain}"
        if self.headline.metric != "psnr" or structure not in keys:
            return []
        return [parse(key) for key in (structure, "brightness_ratio") if key in keys]

    @cached_property
    def control(self) -> list[Score]:
        """The score of control, in a list; none where no record has it."""
        return [score for score in self.scores if score.key == control.NAME]

    @cached_property
    def done(self) -> pd.DataFrame:
        """The records of methods with a score."""
        return self.frame[(self.frame["state"] == DONE) & (self.frame["category"] != FLOOR)]

    @cached_property
    def holes(self) -> pd.DataFrame:
        """The records without a score."""
        return self.frame[self.frame["state"] != DONE]

    @cached_property
    def targets(self) -> list[str]:
        """Names of the targets, those of the dataset first and in its order."""
        return list(dict.fromkeys([*self.facts.targets.index, *self.frame["target"]]))

    @cached_property
    def names(self) -> dict[str, str]:
        """The registered name of each method, or its file and class, by label."""
        rows = self.frame.drop_duplicates("label")
        return dict(zip(rows["label"], rows["method"], strict=True))

    @cached_property
    def clusters(self) -> NDArray[np.str_]:
        """``(targets,)`` names: targets of one cluster, such as crops of one photograph, are not independent."""
        known = clusters_in(self.frame)
        return np.array([known.get(target, target) for target in self.targets])

    @cached_property
    def rows(self) -> dict[tuple[str, str], pd.Series]:
        """The rows of the table by (label, condition), in its order."""
        return {(row["label"], row["condition"]): row for _, row in self.table.iterrows()}

    @cached_property
    def conditions(self) -> list[str]:
        """Conditions that have rows, without the reference and without those that are a change of another."""
        names = dict.fromkeys(name for _, name in self.cells)
        return [name for name in names if not is_reference(name) and name not in self.facts.changed]

    @cached_property
    def changed(self) -> list[str]:
        """Conditions that are a change of another, in the order of the table."""
        return [name for name in dict.fromkeys(name for _, name in self.cells) if name in self.facts.changed]

    def methods(self, condition: str) -> list[str]:
        """Labels with a row under ``condition``, in the order of the table."""
        return [label for label, name in self.cells if name == condition]

    @cached_property
    def cells(self) -> dict[tuple[str, str], pd.DataFrame]:
        """The records of each row of the table, in its order."""
        groups = dict(list(self.frame.groupby(["label", "condition"])))
        return {pair: groups[pair] for pair in _pairs(self.frame, self.facts)}

    @cached_property
    def _means(self) -> dict[tuple[str, str], pd.DataFrame]:
        """Every number of the done cells of a row, by target in the order of the frame, repeats averaged."""
        done = self.frame[self.frame["state"] == DONE]
        means = done.groupby(["label", "condition", "target"], sort=False).mean(numeric_only=True)
        groups = means.groupby(level=["label", "condition"], sort=False)
        return {(str(label), str(name)): rows.droplevel([0, 1]) for (label, name), rows in groups}

    @cached_property
    def _by_target(self) -> dict[tuple[str, str], pd.DataFrame]:
        return {pair: means.reindex(self.targets) for pair, means in self._means.items()}

    def values(self, label: str, condition: str, key: str | None = None) -> Array:
        """``(targets,)`` values of a score (default: the headline), repeats averaged; NaN for holes."""
        column, means = (parse(key) if key else self.headline).column, self._by_target.get((label, condition))
        known = means is not None and column in means
        return means[column].to_numpy(np.float64) if means is not None and known else np.full(len(self.targets), np.nan)

    def is_complete(self, label: str, condition: str, key: str | None = None) -> bool:
        """Whether a method has a value for each target: only then may its mean be compared."""
        return not np.isnan(self.values(label, condition, key)).any()

    def ranking(self, condition: str, key: str | None = None, categories: Sequence[str] = OFFLINE) -> list[str]:
        """Methods of the categories with a value for each target, the only means that may be compared, best first.

        Methods that see the camera for the scored image are not among the others, and are asked for by name.
        """
        score = parse(key) if key else self.headline
        labels = [label for label in self.methods(condition) if self.category(label) in categories]
        complete = [label for label in labels if self.is_complete(label, condition, key)]
        return sorted(complete, key=lambda label: -score.sign * self.values(label, condition, key).mean())

    @cached_property
    def near(self) -> list[str]:
        """The targets, those first whose differences between methods are nearest to the mean ones: what a reader sees
        of them is what the means say."""
        names = [*self.conditions, *self.changed]
        tables = [pd.DataFrame([self.values(label, name) for label in self.methods(name)]) for name in names]
        between = pd.concat([values - values.mean() for values in tables])
        away = between.sub(between.mean(axis=1), axis=0).abs().mean()
        return [self.targets[index] for index in away.sort_values(kind="stable").index]

    def estimate(self, values: Array) -> Estimate:
        """Mean of ``(targets,)`` values and its interval over clusters, without the holes."""
        known = np.isfinite(values)
        return mean_interval(values[known], self.clusters[known])

    def gain(self, label: str, condition: str) -> Estimate | None:
        """Headline score minus that of the baseline, target by target; None without a complete pair of rows."""
        baseline = self.baseline
        if baseline is None or not (self.is_complete(label, condition) and self.is_complete(baseline, condition)):
            return None
        return self.estimate(self.values(label, condition) - self.values(baseline, condition))

    @cached_property
    def floors(self) -> list[str]:
        """Names of the reference rows that have a headline score."""
        rows = (name for name in FLOORS if name in self.methods(REFERENCE))
        return [name for name in rows if np.isfinite(self.rows[name, REFERENCE][self.headline.column])]

    @cached_property
    def display_of(self) -> dict[str, str]:
        """The display of each condition."""
        return dict(zip(self.frame["condition"], self.frame["display"], strict=True))

    def reference(self, condition: str) -> str:
        """The condition of the reference rows that a display's methods are held against: its own where it has any."""
        own = reference_of(self.display_of.get(condition, condition))
        return own if own in self.display_of else REFERENCE

    def shape(self, reference: str) -> tuple[int, ...]:
        """Of the targets of some reference rows, as displays are to show them; none for pictures from files."""
        name, known = self.display_of.get(reference, reference), self.facts.displays
        shape: Any = known.at[name, "shape"] if name in known.index else ()
        return shape

    def has_pictures(self, condition: str) -> bool:
        """Whether the reference rows were scored against the same images as the methods under ``condition``, and made
        the pictures that stand for the targets there.

        Pictures are compared with targets; predictions with the captures of one display.
        """
        return not self.facts.predicts or condition == self.display_of.get(REFERENCE)

    def floor(self, condition: str, less: Array | float = 0.0) -> float | None:
        """The mean of a constant image under ``condition``, less other values of the targets; of those that have both.
        None where there are none."""
        if CONSTANT not in self.floors or not self.has_pictures(condition):
            return None
        values = self.values(CONSTANT, self.reference(condition)) - less
        return float(np.nanmean(values)) if np.isfinite(values).any() else None

    @cached_property
    def tests(self) -> dict[tuple[str, str], PairedTest]:
        """Each method against the baseline on each display, by (label, condition): one family, without oracles."""
        baseline = self.baseline
        rows = [
            (label, condition, self.values(label, condition) - self.values(baseline, condition))
            for condition in self.conditions
            if baseline is not None and baseline in self.methods(condition)
            for label in self.methods(condition)
            if label != baseline
        ]
        if baseline is None or not rows:
            return {}
        holes = np.full(len(self.targets), np.nan)  # in the place of an oracle, which is not in the family
        p = family_p(np.stack([holes if self.category(row[0]) == ORACLE else row[2] for row in rows]), self.clusters)
        return {
            (label, condition): PairedTest(condition, baseline, label, values, self.estimate(values), float(each))
            for (label, condition, values), each in zip(rows, p, strict=True)
        }

    def tested(self, label: str, condition: str) -> PairedTest | None:
        """The test of a method on a display; None where there is no complete pair of rows."""
        both = (label, str(self.baseline))
        return self.tests.get((label, condition)) if all(self.is_complete(name, condition) for name in both) else None

    @cached_property
    def table(self) -> pd.DataFrame:
        """The frame of table.csv, a row per method and condition: means over targets with 95 % intervals over clusters.

        ``n`` counts targets with at least one done cell, ``clusters`` their clusters, and ``failed`` counts cells
        without a score. The headline has a median over targets, too. A metric that only some of the ``n`` targets have
        is left empty, so that its mean always stands for the ``n`` beside it; figures that describe the capture, such
        as the speckle contrast of flat patches, are means over the targets that have them. Only rows with each target
        are ranked, and neither oracle nor floor; equal means share the better place.
        """
        rows, score = pd.DataFrame([self._row(*pair) for pair in self.cells]), parse(self.study.headline)
        if score.column in rows:
            ranked = (rows["n"] == len(self.targets)) & rows[score.column].notna()
            ranked &= ~rows["category"].isin((FLOOR, ORACLE))
            groups = rows[ranked].groupby(["condition", "category"])[score.column]
            rows.loc[ranked, "rank"] = groups.rank(method="min", ascending=not score.higher_is_better)
        return rows

    def _row(self, label: str, condition: str) -> dict[str, Any]:
        cells, published = self.cells[label, condition], self.facts.published(label, condition)
        first, last = ({c.name: self._value(c, cells) for c in part if self._is_tabled(c)} for part in (BEFORE, AFTER))
        names = self.facts.published_metrics
        reported = {f"{PUBLISHED}{parse(name).column}": published.get(name, math.nan) for name in names}
        return first | self._statistics(label, condition) | last | reported

    def _is_tabled(self, column: Column) -> bool:
        return bool(column.table) and (column.name in self.frame or column.name not in RECORDED)

    def _value(self, column: Column, cells: pd.DataFrame) -> Any:
        """A value of table.csv, from the cells of its row."""
        done, label, condition = cells[cells["state"] == DONE], cells["label"].iloc[0], cells["condition"].iloc[0]
        match column.table:
            case "first":
                return cells[column.name].iloc[0]
            case "swept":
                return self.facts.changed.get(condition, UNCHANGED)[column.name]
            case "params":
                return json.dumps(self.facts.of(label, "params", {}), sort_keys=True, ensure_ascii=False)
            case "n":
                return int(done["target"].nunique())
            case "failed":
                return len(cells) - len(done)
            case "clusters":
                return int(done["cluster"].nunique())
            case "mean" | "median":
                return float(getattr(done[column.name], column.table)())
            case "median_alone":  # a machine that stood still for minutes does not move it
                alone = done[done["timed_alone"] == 1] if "timed_alone" in done else done
                wall = float((done if alone.empty else alone)[column.name].median())
                cpu = done["cpu_s"].median() if "cpu_s" in done else math.nan
                return math.nan if wall > DISTURBED * cpu else wall
            case "together":
                return " ".join(sorted({*done[column.name]} - {""}))
            case "total_captures":  # failed cells have taken theirs, too; repeats are averaged, of failed ones apart
                taken = cells.dropna(subset="captures")
                if taken.empty:
                    return math.nan
                trained = taken["training_captures"].mean() if "training_captures" in taken else 0.0
                each = taken.assign(done=taken["state"] == DONE).groupby(["target", "done"], sort=False)["captures"]
                return float(trained + each.mean().groupby("target").max().sum())
            case _:
                return math.nan  # a rank is known once all rows are

    def _statistics(self, label: str, condition: str) -> dict[str, float]:
        """Mean of each score with its interval."""
        means = self._means.get((label, condition), self.frame[score_columns(self.frame)].iloc[:0])
        known = dict(zip(self.targets, self.clusters, strict=True))
        clusters, numbers = np.array([known[target] for target in means.index]), dict[str, float]()
        for score in self.scores:
            values = means[score.column].to_numpy()
            held = ~np.isnan(values)
            if score.domain and not held.all():
                held[:] = False
            estimate = mean_interval(values[held], clusters[held])
            numbers |= dict(zip(score.columns, (estimate.mean, estimate.low, estimate.high), strict=True))
            if score.key == self.study.headline:
                numbers[score.statistic("_median")] = float(np.median(values[held])) if held.any() else math.nan
        return numbers

    @cached_property
    def tests_table(self) -> pd.DataFrame:
        """The frame of tests.csv, without a row where there is no baseline."""
        score = self.headline
        columns: dict[str, list[Any]] = {name: [] for name in TESTED}
        rows = [
            {name: self.rows[test.second, test.condition][name] for name in TESTED}
            | {"baseline": test.first, "metric": score.column, "n": test.estimate.n, "clusters": test.estimate.clusters}
            | {"better": test.better(score.sign), f"difference{score.suffix}": test.estimate.mean}
            | {f"difference_lo{score.suffix}": test.estimate.low, f"difference_hi{score.suffix}": test.estimate.high}
            | {f"difference_median{score.suffix}": test.median}
            | {f"difference_detectable{score.suffix}": test.estimate.detectable, "p_adjusted": test.p}
            for test in self.tests.values()
        ]
        if rows:
            return pd.DataFrame(rows)
        ends = [f"difference{end}{score.suffix}" for end in ("", "_lo", "_hi", "_median", "_detectable")]
        return pd.DataFrame(columns=[*columns, "baseline", "metric", "n", "clusters", "better", *ends, "p_adjusted"])
