"""Error budget: which part of the error of captures an image, a network or a field model explains, and which none."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..data.board import Board
from ..data.error_budget import Budget, Part, budgets
from ..data.results import Results
from ..data.scores import Score
from ..data.statistics import Array
from ..data.text import bracketed, percent, words
from ..markdown import Markdown, table_of
from ..story import is_many
from .kind import Kind


def verdicts(results: Results) -> Iterator[str]:
    """One a display: the parts of the error, and what its removal is worth. Over many displays, one for all."""
    found = budgets(results)
    if not found:
        yield "No display has the scores of all methods for all targets, so none has a budget."
    elif is_many(results):
        over = [(label, means.mean(), means.min(), means.max()) for label, means in _over(found)]
        shares = [f"{label} {mean:.0f} % ({low:.0f} to {high:.0f})" for label, mean, low, high in over]
        yield f"Over {len(found)} displays, the squared error is explained by {words(shares)}."
    else:
        for budget in found:
            yield f"{f'{budget.condition}: ' * (len(found) > 1)}{_reading(budget)}"


def _reading(budget: Budget) -> str:
    """The shares, and the decibels of the last two links of the chain: of the image, and of the field."""
    shares = ", ".join(f"{part.label} {100 * part.share.mean:z.0f} %" for part in budget.parts)
    gains = [f"{part.gain.mean:+.1f} dB with {part.label}" for part in budget.explained[-2:] if part.gain]
    return f"the error is explained by {shares}; at most {words(gains)}."


def _over(found: list[Budget]) -> Iterator[tuple[str, Array]]:
    """The shares of each part on all displays [%]."""
    for parts in zip(*(budget.parts for budget in found), strict=True):
        yield parts[0].label, np.array([100 * part.share.mean for part in parts])


def rows(board: Board) -> Markdown | None:
    """A row a display and part: its share, what removing it and all above it would gain, what it leaves by itself, and
    the control of its model. Over many displays a row a part: the mean and the range of its share."""
    results = board.results
    if found := budgets(results) if is_many(results) else []:
        return table_of(
            [
                {
                    "explained by": label,
                    "share of the squared error [%]": f"{part.mean():.0f}",
                    "least to most of displays": f"{part.min():.0f} to {part.max():.0f}",
                }
                for label, part in _over(found)
            ]
        )
    return table_of(
        [
            {
                "display": budget.condition,
                "explained by": part.label,
                "share of the squared error [%]": percent(part.share),
                "PSNR gained, with all above [dB]": bracketed(part.gain, "z.1f"),
                "left by it alone [%]": percent(part.alone),
                **{score.heading: _control(results, score, part, budget.condition) for score in results.control},
            }
            for budget in budgets(results)
            for part in budget.parts
        ]
    )


def _control(results: Results, score: Score, part: Part, condition: str) -> str:
    is_model = part.label in results.methods(condition)
    return score.in_row(results.row(part.label, condition)) if is_model else "–"


KIND = Kind(
    question="Where does the error of the captures come from, and who can remove it?",
    applies=lambda results: results.layout.measure == "error_budget",
    verdicts=verdicts,
    table=rows,
    limits=(
        "Bounds: a part is what one prediction explains and none before it did, if it is known which prediction to "
        "believe; a hologram gains less from it than its dB, and a larger model or more captures may explain more.",
        "Parts: image-domain terms are a tone curve, shading, blur and haze, fitted on training captures.",
    ),
)
