"""Rank stability: does the order of the methods survive another bench of the same kind?"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy import stats

from ...display.simulated.changes.draws import MODEL, PARAMETERS
from ..board import Board
from ..charts.look import slugs
from ..charts.ranks import draw_ranks
from ..facts import OFFLINE, Swept
from ..markdown import Markdown, bullets, heading, table_of
from ..results import Results
from ..statistics import CLEAR, Array, Cause, Estimate, cause, mean_interval
from ..story import Blocks, Figures, Part, Report
from ..text import bracketed, percent, words

ORDER = 50
QUESTION = "Does the ranking of the methods survive another bench of the same kind?"
TESTS = False
LIMITS = ("Draws: the bench varies within assumed ranges, targets and holograms stay, and brackets are over draws.",)

# Share of the draws in which a method needs a value for every target to be ranked: a method that seldom has would take
# the draws from all others.
ENOUGH = 0.5
# Parameters that are angles over a full turn: neither end of their range is more than the other.
CIRCULAR = frozenset({"zero_phase"})


class Pair(NamedTuple):
    """Two methods, the nominally better one first: by how much it is, nominally and in each draw, and in how many draws
    the order is the other way; a tie is no order."""

    first: str
    second: str
    nominal: float
    draws: Array
    flips: int


class Ranks:
    """The ranking of methods on a display and on the draws of it.

    Methods that see the camera for the scored image, or inside the bench, are not among those that are ranked.

    methods: those that are ranked, nominally best first; unranked: those without every target nominally or in enough
    draws. quality: mean headline, turned so that larger is better, a column a ranked method, a row for the display (0)
    and one for each draw (from 1) in which all of them have every target; ranks: the same as places from 1; equal means
    share the better one. drawn: the parameters of these draws, a column each.
    """

    def __init__(self, swept: Swept, results: Results) -> None:
        self.swept, self.results = swept, results
        names = [swept.before, *(name for _, name in swept.points)]
        labels = [label for label in results.methods(swept.before) if results.category(label) in OFFLINE]
        means = {label: [results.values(label, name).mean() for name in names] for label in labels}
        quality = results.headline.sign * pd.DataFrame(means, range(len(names)), dtype=np.float64)
        known = quality.notna().to_numpy()
        enough = known[0] & known[1:].any(axis=0) & (known[1:].sum(axis=0) >= ENOUGH * known[1:].any(axis=1).sum())
        ranked = [label for label, is_ranked in zip(labels, enough, strict=True) if is_ranked]
        self.unranked = [label for label in labels if label not in ranked]
        self.methods = sorted(ranked, key=lambda label: -results.headline.sign * means[label][0])
        self.quality = quality[self.methods].dropna() if ranked else quality.iloc[:1, :0]
        self.ranks = self.quality.rank(axis=1, method="min", ascending=False)
        self.drawn = pd.DataFrame(swept.drawn, range(1, len(swept.drawn) + 1)).reindex(self.quality.index[1:])

    @cached_property
    def taus(self) -> Array:
        """Kendall's tau-b of each draw's ranking against the nominal one, without draws in which all methods tie."""
        taus = [stats.kendalltau(self.quality.loc[0], row).statistic for _, row in self.quality[1:].iterrows()]
        return np.array([tau for tau in taus if np.isfinite(tau)])

    @property
    def exists(self) -> bool:
        """Whether there is a ranking: two methods that differ on the nominal display and in a draw."""
        return len(self.methods) > 1 and len(self.taus) > 0

    @property
    def tau(self) -> Estimate:
        """Their mean, and its interval over draws."""
        mean = mean_interval(self.taus)
        return replace(mean, high=min(mean.high, 1.0))  # no correlation is larger

    @cached_property
    def pairs(self) -> list[Pair]:
        """Every two ranked methods, those that change places most often first."""
        pairs = []
        for first, second in itertools.combinations(self.methods, 2):
            nominal, *draws = (self.quality[first] - self.quality[second]).tolist()
            flips = int((np.sign(draws) * np.sign(nominal) < 0).sum())
            pairs.append(Pair(first, second, nominal, np.array(draws), flips))
        return sorted(pairs, key=lambda pair: -pair.flips)

    def share(self, draws: int) -> Estimate:
        """A share of the draws with its 95 % interval (Wilson 1927)."""
        total = len(self.quality) - 1
        ends = stats.binomtest(draws, total).proportion_ci(0.95, method="wilson")
        return Estimate(draws / total, float(ends.low), float(ends.high), total, total)

    def first(self, label: str) -> Estimate:
        """Share of draws in which a method is first."""
        return self.share(int((self.ranks[label][1:] == 1).sum()))

    def cause(self, differences: Array) -> Cause | None:
        """What the difference of a pair goes with: of an angle sine and cosine, of a signed parameter its size, too;
        None for nothing that was drawn."""
        known = dict[str, Array]()
        for name, column in self.drawn.items():
            given, values = PARAMETERS[str(name)], column.to_numpy()
            if name in CIRCULAR:
                known |= {f"sine of the {given.words}": np.sin(values), f"cosine of the {given.words}": np.cos(values)}
                continue
            known[given.words] = values
            known |= {f"size of the {given.words}": np.abs(values)} if given.low < 0 < given.high else {}
        strongest = cause(differences, known)
        return strongest if strongest and strongest.is_clear else None


def rankings(results: Results) -> list[Ranks]:
    """One for every display with draws."""
    return [Ranks(swept, results) for swept in results.facts.sweeps if swept.kind == "draw"]


def applies(results: Results) -> bool:
    """Whether a study has draws of a display."""
    return any(swept.kind == "draw" for swept in results.facts.sweeps)


def verdicts(results: Results) -> Iterator[str]:
    """One a display: who is first, how alike the rankings are, and which methods change places most."""
    existing = [each for each in rankings(results) if each.exists]
    if not existing:
        yield "Methods with all scores tie before any draw or in each of them, so there is no ranking to compare."
    for each in existing:
        display, score = each.swept.before, results.headline
        leader = next(label for label in each.methods if each.ranks[label][0] == 1)
        turned = (pair for pair in each.pairs if pair.flips and score.number(abs(pair.nominal)).strip("0."))
        passes = [
            f" Most often {pair.second} passes {pair.first}, on {percent(each.share(pair.flips))} %." for pair in turned
        ]
        yield (
            f"{f'{display}: ' * (len(existing) > 1)}{leader}, best on {display}, is best on "
            f"{percent(each.first(leader))} % of its draws. Kendall's tau of rankings is "
            f"{bracketed(each.tau, '.2f')}.{''.join(passes[:1])}"
        )


def table(board: Board) -> Markdown | None:
    """Where each method stands, nominally and over the draws."""
    existing = [each for each in rankings(board.results) if each.exists]
    return table_of(
        [
            {
                "method": label,
                "nominal rank": f"{places[0]:.0f}",
                "first in [% of draws]": percent(each.first(label)),
                "mean rank": f"{np.mean(places[1:]):.1f}",
                "best rank": f"{min(places[1:]):.0f}",
                "worst rank": f"{max(places[1:]):.0f}",
            }
            for each in existing[:1]
            for label in each.methods
            for places in [each.ranks[label].tolist()]
        ]
    )


def _render(report: Report, _: Figures) -> Blocks:
    yield heading("Rank stability")
    yield (
        f"A draw is another bench of the same kind: {MODEL}. Methods know the nominal optics alone, or were trained on "
        "the nominal display; the same holograms are shown on every draw. Ranks order the means over targets. Brackets "
        "hold 95 % intervals over draws (other benches, the same images); those of shares are Wilson's."
    )
    for each in rankings(report.results):
        yield heading(f"{each.swept.before}, {len(each.swept.points)} draws", 3)
        yield bullets(left_out(each))
        if turned := table_of(list(flips(each)) if each.exists else []):
            yield Markdown(
                "Pairs of methods whose order changes, {}. Goes with: the parameter that predicts the difference best, "
                "if R2 on draws that were left out is {} or more."
            ).format(report.results.headline.axis, CLEAR)
            yield turned
        if drawn := table_of([_drawn(str(name), values) for name, values in each.drawn.items() if len(values)]):
            yield "Parameters that were drawn:"
            yield drawn


def left_out(each: Ranks) -> Iterator[str]:
    """Methods and draws that are in no number, and why."""
    if each.unranked:
        yield (
            "Not ranked, because targets are missing on the nominal display or in more than half of the draws: "
            f"{words(each.unranked)}."
        )
    points, ranked = each.swept.points, each.quality.index[1:]
    left = [str(value) for index, (value, _) in enumerate(points, start=1) if index not in ranked]
    if left and len(ranked):
        yield (
            f"{f'Draws {words(left)} are' if len(left) > 1 else f'Draw {left[0]} is'} left out ({len(left)} of "
            f"{len(points)}): a ranked method lacks a target there (see Holes), as every method does where the camera "
            "cannot be registered."
        )


def flips(each: Ranks) -> Iterator[dict[str, str]]:
    """Of the pairs whose order is the other way in some draw, most often first: by how much, and what it goes with."""
    score = each.results.headline
    for pair in filter(lambda pair: pair.flips, each.pairs):
        cause, text = each.cause(pair.draws), "nothing drawn"
        if cause:
            text = f"{cause.parameter} (rank correlation {cause.rho:+.2f}, R2 {cause.explained:.2f})"
        yield {
            "nominally better": pair.first,
            "than": pair.second,
            f"nominally by{score.brackets}": score.number(pair.nominal, signed=True),
            f"over draws by{score.brackets}": score.estimate(mean_interval(pair.draws), signed=True),
            "other way in [% of draws]": percent(each.share(pair.flips)),
            "goes with": text,
        }


def _drawn(name: str, values: pd.Series[float]) -> dict[str, str]:
    """What was drawn of a parameter, within which range, and where that comes from."""
    parameter = PARAMETERS[name]
    return {
        "parameter": parameter.words,
        "unit": parameter.unit or "–",
        "range": f"{parameter.low:.3g} to {parameter.high:.3g}",
        "drawn": f"{values.min():.3g} to {values.max():.3g}",
        "source of the range": f"{parameter.source}{'; a full turn' * (name in CIRCULAR)}",
    }


def figures(report: Report) -> Iterator[tuple[Path, str]]:
    """Draw a figure for every display that has a ranking; (file, caption) of each."""
    existing = [each for each in rankings(report.results) if each.exists]
    stems = slugs([each.swept.before for each in existing])
    for each in existing:
        path = report.figures / f"quality-ranks-{stems[each.swept.before]}.png"
        draw_ranks(path, each.swept.before, each.ranks, each.taus, each.tau)
        yield (
            path,
            f"Ranks of the methods over {len(each.quality) - 1} draws of {each.swept.before}. Left: share of draws [%] "
            "in which a method has each rank; methods in nominal order, nominal ranks framed. Right: draws by "
            "Kendall's tau-b of their ranking against the nominal one. Dot and bar: mean and 95 % interval; dashed: "
            "unrelated.",
        )


PARTS = (Part(60, _render, applies=lambda report: applies(report.results), details=True),)
