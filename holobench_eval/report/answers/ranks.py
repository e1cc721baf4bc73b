"""Rank stability: does the order of the methods survive another bench of the same kind?"""

from __future__ import annotations

from collections.abc import Iterator

from ..board import Board
from ..data.ranks import Ranks, ranks
from ..markdown import Markdown, table_of
from ..results import Results
from ..text import bracketed, percent, words
from .kind import Kind


def verdicts(results: Results) -> Iterator[str]:
    """One a display: who is first, how alike the rankings are, and which methods change places most."""
    found = [each for each in ranks(results) if each.exists]
    if not found:
        yield "Methods with all scores tie before any draw or in each of them, so there is no ranking to compare."
    for each in found:
        before = f"{each.swept.before}: " * (len(found) > 1)
        nominal = [label for label, rank in zip(each.methods, each.nominal_positions, strict=True) if rank == 1]
        yield (
            f"{before}{words(nominal)}, first on {each.swept.before}, is first on {percent(each.first(nominal[0]))} % "
            f"of its draws; Kendall's tau with its ranking is {bracketed(each.tau, '.2f')}{_turning(each)}."
        )


def _turning(each: Ranks) -> str:
    apart = [pair for pair in each.pairs if pair.flips and each.results.headline.number(abs(pair.nominal)).strip("0.")]
    if not apart:
        return ""
    most = max(apart, key=lambda pair: pair.flips)
    return f"; {most.second} passes {most.first} most often, on {percent(most.flipped)} %"


def rows(board: Board) -> Markdown | None:
    """Where each method stands, nominally and over the draws."""
    each = next((each for each in ranks(board.results) if each.exists), None)
    if each is None:
        return None
    return table_of(
        [
            {
                "method": label,
                "nominal rank": f"{nominal:.0f}",
                "first in [% of draws]": percent(each.first(label)),
                "mean rank": f"{places.mean():.1f}",
                "best rank": f"{places.min():.0f}",
                "worst rank": f"{places.max():.0f}",
            }
            for label, nominal, places in zip(each.methods, each.nominal_positions, each.positions.T, strict=True)
        ]
    )


KIND = Kind(
    question="Does the ranking of the methods survive another bench of the same kind?",
    applies=lambda results: bool(ranks(results)),
    verdicts=verdicts,
    table=rows,
    limits=(
        "Draws: the bench varies within assumed ranges, target images and holograms stay, and brackets of shares and "
        "of tau are over draws and not over images.",
    ),
)
