"""A kind of study: the question that it asks, the verdict on each display, and the table behind it."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from ..board import Board
from ..markdown import Markdown
from ..results import Results
from ..text import words
from .board import board_table

MOST_WORDS = 40  # of a verdict


@dataclass(frozen=True)
class Kind:
    """A kind of study.

    question: what it asks, for a config that states no question; applies: whether a study is of this kind; verdicts:
    one of at most ``MOST_WORDS`` words for each display, or for all; table: what they rest on (None: there is nothing
    to show); limits: those of this kind alone.
    """

    question: str
    applies: Callable[[Results], bool]
    verdicts: Callable[[Results], Iterable[str]]
    table: Callable[[Board], Markdown | None] = board_table
    limits: tuple[str, ...] = ()

    def answer(self, results: Results) -> list[str]:
        """The verdicts; a sentence in their place where no score allows one."""
        if not results.conditions or results.done.empty:
            return ["No cell of the study has a score, so there is no answer."]
        found = [verdict for verdict in self.verdicts(results) if verdict]
        told = mentioned(results.labels, " ".join(found))
        if untold := [label for label in subjects(results) if label not in told]:
            found[:0] = [f"Nothing is said of {words(untold)}: a score is missing, of a target or of the baseline."]
        return found or ["Too many scores are missing for an answer."]


def subjects(results: Results) -> list[str]:
    """The methods that the question names, in its order, without baseline and oracles: those it is about."""
    aside = {results.baseline, *results.facts.oracles}
    return [label for label in mentioned(results.labels, results.study.question) if label not in aside]


def mentioned(names: Iterable[str], text: str) -> list[str]:
    """The names that stand in a text, in its order; the longest counts where one begins another."""
    longest = sorted(set(names), key=lambda name: (-len(name), name))
    pattern = "|".join(rf"(?<![\w-]){re.escape(name)}(?![\w-])" for name in longest)
    return list(dict.fromkeys(match[0] for match in re.finditer(pattern, text))) if longest else []
