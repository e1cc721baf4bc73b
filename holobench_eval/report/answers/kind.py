"""A kind of study: the question that it asks, the sentences that answer it, and the table behind them."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from ..data.results import Results
from ..data.text import words
from ..markdown import Markdown

MOST_SENTENCES = 5
MOST_COLUMNS = 8
PAPER = "Chakravarthula et al. 2020, ACM Trans. Graph. 39(6), 186, doi:10.1145/3414685.3417846."


@dataclass(frozen=True)
class Kind:
    """A kind of study.

    question: what it asks, for a config that states no question; applies: whether a study is of this kind; sentences:
    the answer, the most important sentence first; table: what the answer rests on, of at most ``MOST_COLUMNS`` columns
    (None: there is nothing to show); limits: those of this kind alone.
    """

    question: str
    applies: Callable[[Results], bool]
    sentences: Callable[[Results], Iterable[str]]
    table: Callable[[Results], Markdown | None]
    limits: tuple[str, ...] = ()

    def answer(self, results: Results) -> list[str]:
        """At most ``MOST_SENTENCES`` sentences; where there are more, the last one says where they stand."""
        found = self.whole_answer(results)
        if len(found) <= MOST_SENTENCES:
            return found
        kept = found[: MOST_SENTENCES - 1]
        return [*kept, f"{len(found) - len(kept)} more findings are in the first section of details.md."]

    def whole_answer(self, results: Results) -> list[str]:
        """All sentences of the answer."""
        if not results.conditions or results.done.empty:
            return ["No cell of the study has a score, so there is no answer."]
        found = [sentence for sentence in self.sentences(results) if sentence]
        told = _mentioned(results.layout.methods, " ".join(found))
        if untold := [label for label in subjects(results) if label not in told]:
            found[:0] = [f"Nothing is said of {words(untold)}: a score is missing, of a target or of the baseline."]
        return found or ["Too many scores are missing for an answer."]


def subjects(results: Results) -> list[str]:
    """The methods that the question names, in its order, without baseline and oracles: those it is about."""
    layout = results.layout
    aside = {layout.baseline, *layout.privileged}
    return [label for label in _mentioned(layout.methods, layout.question) if label not in aside]


def named(results: Results, text: str) -> dict[str, str]:
    """What the methods and displays are whose names stand in a text, by name, in its order."""
    about = {**results.layout.about, "the paper": PAPER}
    return {name: about[name] for name in _mentioned((*results.layout.methods, *about), text) if name in about}


def _mentioned(names: Iterable[str], text: str) -> list[str]:
    """The names that stand in a text, in its order; the longest counts where one begins another."""
    longest = sorted(set(names), key=lambda name: (-len(name), name))
    pattern = "|".join(rf"(?<![\w-]){re.escape(name)}(?![\w-])" for name in longest)
    return list(dict.fromkeys(match[0] for match in re.finditer(pattern, text))) if longest else []
