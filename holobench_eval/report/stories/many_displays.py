"""Many displays: on how many is a method better, by how much over all of them, and what decides it?

The map is what a lab can measure of a display on its own, and what it tells of the methods on displays like it: a line
in two shares of an error budget is fitted to the margins of every method, and asked of a display that it was not fitted
to. So it is told whether the shares name the best method of a display, and what their choice costs.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from ...display.simulated.origins import families, load_family, value_of
from ...display.simulated.origins import parameters as ranges
from ..board import Board
from ..charts import paired
from ..charts.family import draw_map
from ..charts.look import looks
from ..markdown import Markdown, table_of
from ..phrases import effect
from ..results import Results
from ..statistics import FEWEST_DISPLAYS, Array, Estimate, cause, two_way
from ..story import Report, is_many, subjects
from ..text import words
from .comparison import published
from .error_budget import budgets
from .prediction import is_untestable

ORDER = 70
QUESTION = "On how many of the displays is a method better than the baseline, and by how much over all of them?"
LIMITS = ("Family: the displays are drawn from assumed ranges, and an interval over them speaks for such displays.",)
MOST = 2  # methods that the answer names beside those of the question
MOST_DRAWN = 5  # in the map


def applies(results: Results) -> bool:
    """Whether a study compares methods, and not only oracles, with a baseline over many displays."""
    compared = {*results.labels} - {*results.facts.oracles, results.baseline}
    return is_many(results) and not results.facts.predicts and results.baseline is not None and bool(compared)


def shown_on(results: Results) -> list[str]:
    """The displays on which every method that is compared has a score for every target."""
    rows = [label for label in results.labels if label not in results.facts.oracles]
    return [name for name in results.conditions if all(results.is_complete(label, name) for label in rows)]


class Margin(NamedTuple):
    """A method minus the baseline. values: ``(displays,)`` means over targets, with their 5, 50 and 95 % quantiles;
    over_both: their mean, with an interval over displays and clusters of targets together; better, worse: displays on
    which the family of tests shows it."""

    label: str
    values: Array
    low: float
    median: float
    high: float
    over_both: Estimate
    better: int
    worse: int


def margins(results: Results) -> list[Margin]:
    """Every method but the baseline and oracles, the best first."""
    where, sign, baseline = shown_on(results), results.headline.sign, str(results.baseline)
    clusters, index = np.unique(results.clusters, return_inverse=True)
    shares, rows = np.eye(len(clusters))[index] / np.bincount(index), list[Margin]()
    for label in results.labels if where else ():
        if label != baseline and label not in results.facts.oracles:
            own, other = ([results.values(row, name) for name in where] for row in (label, baseline))
            differences = np.subtract(own, other)
            tests = [test for test in results.tests.values() if test.second == label and test.condition in where]
            effects = [effect(results.headline, test) for test in tests]
            values, by_cluster = differences.mean(1), differences @ shares
            low, median, high = np.quantile(values, (0.05, 0.5, 0.95))
            over_both = Estimate(*two_way(by_cluster), *by_cluster.shape)
            better, worse = effects.count("better"), effects.count("worse")
            rows.append(Margin(label, values, low, median, high, over_both, better, worse))
    return sorted(rows, key=lambda row: -sign * row.over_both.mean)


def verdicts(results: Results) -> Iterator[str]:
    """The methods of the question; which is best, and what tells it; the best ones; what decides their margins; what
    judges their models; where no score could be had."""
    rows, where = margins(results), shown_on(results)
    if not rows:
        yield "No display has a score of every method for every target."
        return
    about, count = [row for label in subjects(results) for row in rows if row.label == label], len(where)
    yield from (_beats(results, row, count) for row in about)
    if len(rows) > 1:
        yield from _best(results)
        yield from (_beats(results, row, count) for row in [row for row in rows if row not in about][:MOST])
    if parts := [f"in {right} of {pairs} pairs by {name}" for name, (right, pairs) in judged(results).items()]:
        yield f"Of two methods on a display, that with the better model is better {words(parts)}."
    known = parameters(results)
    for row in about or rows[:1]:
        if (decides := cause(row.values, known)) and decides.is_clear:
            share = f"rank correlation {decides.rho:+.2f}, R2 {decides.explained:.2f} on displays left out"
            yield f"{decides.parameter.capitalize()} decides the margin of {row.label}: {share}."
        elif decides:
            yield f"No parameter of the displays predicts the margin of {row.label}."
    if left := [name for name in results.conditions if name not in where]:
        yield f"Left out, since scores are missing: {words(left)}."


def _beats(results: Results, row: Margin, count: int) -> str:
    score, worse = results.headline, f" and loses on {row.worse}" * bool(row.worse)
    ends = " to ".join(score.number(end, signed=True) for end in (row.low, row.high))
    beats = f"beats {results.baseline} on {row.better} of {count} displays{worse}"
    if is_untestable(results):
        beats = f"against {results.baseline} on {count} displays, untested"
    text = f"{row.label} {beats}: median "
    text += f"{score.with_unit(row.median, signed=True)}, nine in ten {ends}."
    margin = published(results, row.label, results.conditions[0])
    if margin is None:
        return text
    above = int((row.values >= margin).sum())
    return f"{text} The published {score.with_unit(margin, signed=True)} is reached on {above or 'none'}."


def gains(results: Results) -> pd.DataFrame:
    """By how much each method is better than the baseline, which is the first; a row for each of ``shown_on``."""
    rows = {row.label: results.headline.sign * row.values for row in margins(results)}
    return pd.DataFrame({str(results.baseline): 0.0, **rows}, index=shown_on(results))


def _best(results: Results) -> Iterator[str]:
    """The method that is best on most displays, and whether an error budget of a display tells where another is."""
    gained, known, score = gains(results), display_map(results), results.headline
    count, best = len(gained), gained.idxmax(axis=1).value_counts().reindex(gained.columns, fill_value=0)
    usual, tied = str(best.idxmax()), [str(label) for label in best.index[best == best.max()]]
    yield f"Best on most displays: {words(tied)}, on {best[usual]} of {count}{' each' * (len(tied) > 1)}."
    if known:
        always, asked = (known.behind(margins) for margins in (gained[usual], known.chosen))
        nothing, budget = f"always taking {usual} costs {score.with_unit(always)}", f"costs {score.with_unit(asked)}"
        how = "an error budget" if asked < always else "nothing"
        named = f"an error budget names the best method on {known.hits} of {count} displays left out and {budget}"
        yield f"To choose, measure {how}: {nothing} in the mean; {named}."
        labels = [label for label in dict.fromkeys([*subjects(results), usual]) if label != results.baseline]
        shares = words([f"{max(known.explained(label), 0):.2f} for {label}" for label in labels])
        yield f"An error budget predicts margins on displays left out with R2 {shares}."


@dataclass(frozen=True)
class Map:
    """Displays by two shares of the squared error of captures, and the margins of methods on them; a row a display.

    shares: columns named after what explains them; margins, predicted: a column a method, the baseline among them; the
    latter by the lines that were fitted to all displays but the one.
    """

    shares: pd.DataFrame
    margins: pd.DataFrame
    predicted: pd.DataFrame

    @property
    def hits(self) -> int:
        """Displays whose best method the shares name."""
        return int((self.predicted.idxmax(axis=1) == self.margins.idxmax(axis=1)).sum())

    @property
    def chosen(self) -> pd.Series:
        """The margins of the methods that the shares name."""
        return pd.Series({name: self.margins.at[name, label] for name, label in self.predicted.idxmax(axis=1).items()})

    def behind(self, margins: pd.Series) -> float:
        """How far some margins stay behind the best ones, over displays."""
        return float((self.margins.max(axis=1) - margins).mean())

    def explained(self, label: str) -> float:
        """The share of the variance of a method's margin over displays that the lines predict (R2, leaving one out); 0
        where it does not vary."""
        values, count = self.margins[label], len(self.margins)
        others = (values.mean() - values) * count / (count - 1)  # from the mean of all displays but the one
        missed, all_others = np.square(values - self.predicted[label]).sum(), np.square(others).sum()
        return float(1 - missed / all_others) if all_others else 0.0


def display_map(results: Results) -> Map | None:
    """The map from the first error budget among the related studies that has all displays; None without one."""
    gained = gains(results)
    for other in results.related.values():
        known = {budget.condition: budget.explained for budget in budgets(other)}
        if len(gained) and known.keys() >= {*gained.index}:
            *image, field = known[gained.index[0]]  # in the order of the config, the last one knows most
            shares = [[part.share.mean for part in known[name]] for name in gained.index]
            axes = [f"{image[-1].label} and what knows less", f"{field.label} alone"]
            known_by = pd.DataFrame([[sum(row[:-1]), row[-1]] for row in shares], gained.index, axes)
            return Map(known_by, gained, gained - missed(known_by, gained))
    return None


def missed(shares: pd.DataFrame, values: pd.DataFrame) -> pd.DataFrame:
    """What lines in some shares miss of each display when they are fitted to all others.

    Of a least-squares fit with hat matrix H, the residual of a point left out is r / (1 - h) (Allen, Technometrics 16,
    125, 1974).
    """
    design = np.column_stack([np.ones(len(shares)), shares])
    hat = design @ np.linalg.pinv(design)
    return (values - hat @ values.to_numpy()).div(1 - np.diag(hat), axis=0)


def parameters(results: Results) -> dict[str, Array]:
    """What differs between the displays of a family, ``(displays,)`` by words; empty where they are of none."""
    profiles = [results.facts.profiles[name] for name in shown_on(results) if name in results.facts.profiles]
    family = next((name for name in families() if all(each.name.startswith(f"{name}-") for each in profiles)), None)
    if family is None or len(profiles) < FEWEST_DISPLAYS:
        return {}
    values = {
        given["words"]: np.array([np.mean(value_of(profile, given["name"])) for profile in profiles])
        for given in ranges(load_family(family))
    }
    return {name: column for name, column in values.items() if np.ptp(column) > 0}


def judged(results: Results) -> dict[str, tuple[int, int]]:
    """How often control and prediction of models name the better of two methods that optimise through them.

    From the related study that measured both: right ones and pairs over displays, by the title of the score.
    """
    gained, pairs = gains(results), dict[str, tuple[int, int]]()
    models = (each for each in results.related.values() if each.study.measure == "prediction" and each.control)
    for other in itertools.islice(models, 1):
        for score in (*other.control, other.headline):
            agree = []
            for name, gain in zip(shown_on(results), gained.to_dict("records"), strict=True):
                means = {
                    label: other.values(label, name, score.key).mean()
                    for label in other.methods(name)
                    if label in gained.columns[1:] and other.is_complete(label, name, score.key)
                }
                for first, second in itertools.combinations(means, 2):
                    agree.append((gain[first] - gain[second]) * (means[first] - means[second]) > 0)
            pairs[score.title] = sum(agree), len(agree)
    return pairs


def table(board: Board) -> Markdown | None:
    """A row for every method."""
    score, count = board.results.headline, len(shown_on(board.results))
    is_tested = not is_untestable(board.results)
    return table_of(
        [
            {
                "method": row.label,
                f"over displays and pictures{score.brackets}": score.estimate(row.over_both, signed=True),
                f"median{score.brackets}": score.number(row.median, signed=True),
                "5 to 95 % of displays": " to ".join(score.number(end, signed=True) for end in (row.low, row.high)),
                f"better on [of {count}]": row.better if is_tested else "–",
                "worse on": row.worse if is_tested else "–",
            }
            for row in margins(board.results)
        ]
    )


def figures(report: Report) -> Iterator[tuple[Path, str]]:
    """Margins, and margins against what an error budget found, of the best methods and those of the question."""
    results, path = report.results, report.figures / "quality-displays.png"
    if not (applies(results) and shown_on(results)):
        return
    known, baseline, looked = margins(results), results.baseline, looks(results.names)
    rows = [paired.Row(row.label, row.values, row.over_both, looked[row.label]) for row in known]
    figures = {row.label: published(results, row.label, results.conditions[0]) for row in known}
    lines = {f"published for {label}": value for label, value in figures.items() if value is not None}
    paired.draw_rows(results, path, f"{len(shown_on(results))} displays", rows, lines)
    yield (
        path,
        f"Differences to {baseline} in {results.headline.axis}. Small dots: displays, at the same "
        "height in every row; marks and bars: means and their 95 % intervals over displays and clusters of targets.",
    )
    if drawn := display_map(results):
        wanted = list(dict.fromkeys([*subjects(results), *drawn.margins.columns[1:]]))[:MOST_DRAWN]
        path, axis = report.figures / "quality-map.png", f"difference to {baseline} in {results.headline.axis}"
        draw_map(path, 100 * drawn.shares, drawn.margins, axis, {label: looked[label] for label in wanted})
        yield (
            path,
            f"Differences to {baseline}, a mark a display, against two parts of its error, as error "
            "budgets of the displays found them. Lines: least squares, for the eye.",
        )
