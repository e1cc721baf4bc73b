"""The numbers of a study, ready to be asked: values by target, ranks, paired tests, floors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from ...core.errors import UserError, suggest
from ...metrics import control
from ...study.plan import FLOORS, REFERENCE, is_reference, reference_of
from .layout import FLOOR, OFFLINE, ORACLE, Layout
from .scores import Score, parse
from .statistics import Array, Estimate, PairedTest, family_p, mean_interval
from .tables import DONE, clusters_in, per_target, score_columns, table_from_records

CONSTANT = "floor_constant"
# Metrics of the main table besides the headline.
LEADING = ("psnr", "ssim", "ms_ssim", "lpips_alex", "lpips_vgg", "mofd", control.NAME)


@dataclass(frozen=True)
class Results:
    """A records frame with the layout of its study, see ``tables.records_frame``, and those of parts that predict."""

    frame: pd.DataFrame
    layout: Layout
    related: Mapping[str, Results] = field(default_factory=dict)

    @cached_property
    def table(self) -> pd.DataFrame:
        """A row per method and condition, as in table.csv."""
        return table_from_records(self.frame, self.layout)

    @cached_property
    def scores(self) -> list[Score]:
        """Every score of the records, in the order of the tables."""
        return [parse(name) for name in score_columns(self.frame)]

    @cached_property
    def headline(self) -> Score:
        """The headline metric. UserError when no record has it, though some were scored."""
        keys = [score.key for score in self.scores]
        if keys and self.layout.headline not in keys:
            plain = [score.key for score in self.scores if score.domain and not score.variant]
            raise UserError(
                f"headline '{self.layout.headline}' is in no record; {suggest(self.layout.headline, plain)}"
            )
        return parse(self.layout.headline)

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
    def targets(self) -> list[str]:
        """Names of the targets, those of the dataset first and in its order."""
        return list(dict.fromkeys([*self.layout.targets, *self.frame["target"]]))

    @cached_property
    def names(self) -> dict[str, str]:
        """The registered name of every method, or its file and class, by label."""
        rows = self.frame.drop_duplicates("label")
        return dict(zip(rows["label"], rows["method"], strict=True))

    @cached_property
    def clusters(self) -> NDArray[np.str_]:
        """``(targets,)`` names: targets of one cluster, such as crops of one photograph, are not independent."""
        known = clusters_in(self.frame)
        return np.array([known.get(target, target) for target in self.targets])

    def estimate(self, values: Array) -> Estimate:
        """Mean of ``(targets,)`` values and its interval over clusters, without the holes."""
        known = np.isfinite(values)
        return mean_interval(values[known], self.clusters[known])

    @cached_property
    def conditions(self) -> list[str]:
        """Conditions that have rows, without the reference and without those that are a change of another."""
        names = dict.fromkeys(self.table["condition"])
        return [name for name in names if not is_reference(name) and name not in self.layout.changed]

    @cached_property
    def changed(self) -> list[str]:
        """Conditions that are a change of another, in the order of the table."""
        return [name for name in dict.fromkeys(self.table["condition"]) if name in self.layout.changed]

    def methods(self, condition: str) -> list[str]:
        """Labels with a row under ``condition``, in the order of the table."""
        return [label for label, name in self._rows if name == condition]

    def row(self, label: str, condition: str) -> pd.Series:
        """A row of the table."""
        return self._rows[label, condition]

    @cached_property
    def _rows(self) -> dict[tuple[str, str], pd.Series]:
        """The rows of the table, in its order."""
        return {(row["label"], row["condition"]): row for _, row in self.table.iterrows()}

    def cells(self, label: str, condition: str) -> pd.DataFrame:
        """The records of a method under a condition."""
        return self.frame[(self.frame["label"] == label) & (self.frame["condition"] == condition)]

    def values(self, label: str, condition: str, key: str | None = None) -> Array:
        """``(targets,)`` values of a score (default: the headline), repeats averaged; NaN for holes."""
        column = (parse(key) if key else self.headline).column
        means = self._means.get((label, condition), pd.DataFrame())
        return means[column].to_numpy(np.float64) if column in means else np.full(len(self.targets), np.nan)

    @cached_property
    def _means(self) -> dict[tuple[str, str], pd.DataFrame]:
        """Every number of a method under a condition, a row for each of ``targets``."""
        return {pair: means.reindex(self.targets) for pair, means in per_target(self.frame).items()}

    def is_complete(self, label: str, condition: str, key: str | None = None) -> bool:
        """Whether a method has a value for every target: only then may its mean be compared."""
        return not np.isnan(self.values(label, condition, key)).any()

    def ranking(self, condition: str, key: str | None = None, categories: Sequence[str] = OFFLINE) -> list[str]:
        """Methods of the categories with a value for every target, the only means that may be compared, best first.

        Methods that see the camera for the scored image are not among the others, and are asked for by name.
        """
        score = parse(key) if key else self.headline
        labels = [label for label in self.methods(condition) if self.layout.category(label) in categories]
        complete = [label for label in labels if self.is_complete(label, condition, key)]
        return sorted(complete, key=lambda label: -score.sign * self.values(label, condition, key).mean())

    def oracle(self, condition: str) -> str | None:
        """The best complete privileged method."""
        return next(iter(self.ranking(condition, categories=(ORACLE,))), None)

    def gain(self, label: str, condition: str) -> Estimate | None:
        """Headline score minus that of the baseline, target by target; None without a complete pair of rows."""
        baseline = self.layout.baseline
        if baseline is None or not (self.is_complete(label, condition) and self.is_complete(baseline, condition)):
            return None
        return self.estimate(self.values(label, condition) - self.values(baseline, condition))

    @cached_property
    def floors(self) -> list[str]:
        """Names of the reference rows that have a headline score."""
        rows = (name for name in FLOORS if name in self.methods(REFERENCE))
        return [name for name in rows if np.isfinite(self.row(name, REFERENCE)[self.headline.column])]

    def reference(self, condition: str) -> str:
        """The condition of the reference rows that a display's methods are held against: its own where it has any."""
        own = reference_of(self.display_of.get(condition, condition))
        return own if own in self.display_of else REFERENCE

    def shape(self, reference: str) -> tuple[int, ...]:
        """Of the targets of some reference rows, as displays are to show them; none for pictures from files."""
        return self.layout.shapes.get(self.display_of.get(reference, reference), ())

    @cached_property
    def display_of(self) -> dict[str, str]:
        """The display of every condition."""
        return dict(zip(self.frame["condition"], self.frame["display"], strict=True))

    def has_pictures(self, condition: str) -> bool:
        """Whether the reference rows were scored against the same images as the methods under ``condition``, and made
        the pictures that stand for the targets there.

        Pictures are compared with targets; predictions with the captures of one display.
        """
        return not self.layout.predicts or condition == self.display_of.get(REFERENCE)

    @cached_property
    def holes(self) -> pd.DataFrame:
        """The records without a score."""
        return self.frame[self.frame["state"] != DONE]

    @cached_property
    def against_baseline(self) -> list[PairedTest]:
        """Every method against the baseline on every display: one family of tests, in which the oracle is not."""
        baseline = self.layout.baseline
        rows = [
            (condition, label, self.values(label, condition) - self.values(baseline, condition))
            for condition in self.conditions
            if baseline is not None and baseline in self.methods(condition)
            for label in self.methods(condition)
            if label != baseline
        ]
        if baseline is None or not rows:
            return []
        holes = np.full(len(self.targets), np.nan)  # in the place of an oracle, which is not in the family
        p = family_p(np.stack([holes if row[1] in self.layout.privileged else row[2] for row in rows]), self.clusters)
        return [
            PairedTest(condition, baseline, label, found, self.estimate(found), float(value))
            for (condition, label, found), value in zip(rows, p, strict=True)
        ]

    @cached_property
    def tests(self) -> dict[tuple[str, str], PairedTest]:
        """``against_baseline`` by (method, condition)."""
        return {(test.second, test.condition): test for test in self.against_baseline}

    def floor(self, condition: str, less: Array | float = 0.0) -> float | None:
        """The mean of a constant image under ``condition``, less other values of the targets; of those that have both.
        None where there are none."""
        if CONSTANT not in self.floors or not self.has_pictures(condition):
            return None
        values = self.values(CONSTANT, self.reference(condition)) - less
        return float(np.nanmean(values)) if np.isfinite(values).any() else None
