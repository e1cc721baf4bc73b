"""Reading score keys: ``psnr_linear_blur1`` is a metric, a domain and a variant, and has a title, a unit and digits."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
import pandas as pd

from ..metrics.catalogue import catalogue
from .statistics import Estimate
from .text import bracketed

DOMAINS = ("linear", "amplitude", "srgb", "stored")
DOMAIN_NAMES = {"linear": "linear light", "amplitude": "amplitude", "srgb": "sRGB", "stored": "values as stored"}

METRICS = {metric.name: metric for metric in catalogue()}
_FACTORS = {"scale_0": "match factor (red)", "scale_1": "match factor (green)", "scale_2": "match factor (blue)"}

_PATTERN = re.compile(rf"(?P<metric>\w+?)_(?P<domain>{'|'.join(DOMAINS)})(?:_(?P<variant>\w[\w.]*))?")
_BLUR = re.compile(r"blur_?(?P<width>\d+(?:[.p]\d+)?)")
_WIDTH = re.compile(r"(_blur\d+(?:\.\d+)?)(?:px)?")
_SUFFIXES = tuple({f"_{metric.unit.lower()}" for metric in METRICS.values() if metric.unit})


@dataclass(frozen=True)
class Score:
    """A score key in its parts; ``domain`` is empty for figures that are not image metrics, such as an efficiency.

    A key is what configs and records say, ``psnr_linear``; a column of a frame or file has its unit, too.
    """

    key: str
    metric: str
    domain: str = ""
    variant: str = ""

    @property
    def name(self) -> str:
        """The metric's usual name."""
        metric = METRICS.get(self.metric)
        return (metric.title if metric else _FACTORS.get(self.metric)) or self.metric.replace("_", " ")

    @property
    def title(self) -> str:
        """The name, and whether it is of what is in focus."""
        return f"{self.name} in focus" if self.in_focus else self.name

    @property
    def in_focus(self) -> bool:
        """Whether it is the score of what is in focus at the plane of a focal stack, and not of the whole picture."""
        return self.variant == "infocus"

    @property
    def unit(self) -> str:
        """Unit, empty for pure numbers."""
        return METRICS[self.metric].unit if self.metric in METRICS else ""

    @property
    def suffix(self) -> str:
        """The end of its columns: ``_db``, empty for pure numbers."""
        return f"_{self.unit.lower()}" if self.unit else ""

    @cached_property
    def column(self) -> str:
        """Its column in frames and files: ``psnr_linear_blur1px_db``."""
        return self.statistic("")

    def statistic(self, end: str) -> str:
        """The column of a statistic over targets, which ``end`` says: ``psnr_linear_lo_db``."""
        return _WIDTH.sub(r"\1px", self.key) + end + self.suffix

    @property
    def brackets(self) -> str:
        """The unit as it ends a heading: `` [dB]``, empty for pure numbers."""
        return f" [{self.unit}]" if self.unit else ""

    @property
    def axis(self) -> str:
        """Title with domain and unit, for an axis or a sentence: ``PSNR, linear light [dB]``."""
        domain = f", {DOMAIN_NAMES[self.domain]}" if self.domain else ""
        return f"{self.title}{domain}{self.brackets}"

    @property
    def heading(self) -> str:
        """Of a column: title, domain, unit, and the direction where lower is better."""
        return f"{self.axis}{'' if self.higher_is_better else ' (lower is better)'}"

    @property
    def higher_is_better(self) -> bool:
        """The direction of the metric."""
        if self.metric in METRICS:
            return METRICS[self.metric].direction == "higher"
        return self.key != "speckle_contrast"

    @property
    def sign(self) -> int:
        """1 where higher is better, else -1."""
        return 1 if self.higher_is_better else -1

    @property
    def blur(self) -> float | None:
        """Standard deviation in pixels of the blur put on both images before scoring; None without one."""
        match = _BLUR.fullmatch(self.variant)
        return float(match["width"].replace("p", ".")) if match else None

    def with_unit(self, value: float, signed: bool = False) -> str:
        """The value with the metric's digits and unit: ``17.62 dB``, ``0.475``, ``+1.20 dB``."""
        return f"{self.number(value, signed)} {self.unit}".rstrip()

    def number(self, value: float, signed: bool = False) -> str:
        """The value with the metric's digits; a dash for NaN."""
        return "–" if np.isnan(value) else f"{value:{self._form(signed)}}"

    def _form(self, signed: bool) -> str:
        """How its numbers are formatted."""
        return f"{'+' if signed else ''}z.{METRICS[self.metric].digits if self.metric in METRICS else 3}f"

    def estimate(self, estimate: Estimate | None, signed: bool = False, unit: bool = False) -> str:
        """``17.62 [16.90, 18.31]``; the mean alone where there is no interval, a dash for None. unit: of the mean."""
        return bracketed(estimate, self._form(signed), unit=f" {self.unit}".rstrip() if unit else "")

    def in_row(self, row: pd.Series) -> str:
        """Mean and interval of the score in a row of the table."""
        return self.estimate(self.of(row))

    @property
    def columns(self) -> tuple[str, str, str]:
        """The columns of its mean in the table, and of the ends of the interval."""
        return self.column, self.statistic("_lo"), self.statistic("_hi")

    def of(self, row: pd.Series) -> Estimate:
        """Mean of the score in a row of the table with its interval."""
        mean, low, high = (float(row[name]) for name in self.columns)
        return Estimate(mean, low, high, int(row["n"]), int(row["clusters"]))

    def better(self, a: float, b: float) -> bool:
        """Is ``a`` better than ``b``?"""
        return a > b if self.higher_is_better else a < b


@lru_cache(maxsize=1024)
def parse(name: str) -> Score:
    """A score in its parts, from its key or from its column."""
    key = _WIDTH.sub(r"\1", name)
    for suffix in _SUFFIXES:
        if key.endswith(suffix) and (score := _parts(key.removesuffix(suffix))).suffix == suffix:
            return score
    return _parts(key)


def _parts(key: str) -> Score:
    match = _PATTERN.fullmatch(key)
    if match is None:
        return Score(key, key)
    return Score(key, match["metric"], match["domain"], match["variant"] or "")


def order_scores(keys: Iterable[str]) -> list[str]:
    """Scores in the order of tables: plain before variants, metrics as in their catalogue, linear light first."""

    def rank(key: str) -> tuple[bool, str, int, int, str]:
        score = parse(key)
        metric = [*METRICS, score.metric].index(score.metric)  # what the catalogue lacks comes last
        return not score.domain, score.variant, metric, [*DOMAINS, score.domain].index(score.domain), key

    return sorted(set(keys), key=rank)
