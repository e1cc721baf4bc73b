"""A kind of study: the question that it asks, the verdict on each display, and the table behind it."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from ..data.board import Board
from ..data.results import Results
from ..markdown import Markdown
from ..stories import MOST_WORDS as MOST_WORDS
from ..stories.comparison import table as board_table
from ..story import mentioned as mentioned
from ..story import subjects as subjects


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
