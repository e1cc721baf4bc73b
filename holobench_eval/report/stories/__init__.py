"""The stories of a report, each a file: what a kind of study asks, its verdicts, its table, its charts, its details.

A story is a module of this folder with these names, all optional but the first:

- ``ORDER``: its place; the first story with a question that ``applies`` is the study's own.
- ``QUESTION``: what such a study asks, for a config that states no question; with ``applies(results)``, whether a
  study is of this kind, and ``verdicts(results)``, each of at most ``MOST_WORDS`` words, for each display or for all.
- ``table(board)``: what the verdicts rest on, None where there is nothing to show; by default the board.
- ``TESTS``: False where its verdicts rest on no test of two methods.
- ``LIMITS``: how far such an answer goes, each a name, a colon and a sentence.
- ``PARTS``: what it adds to the two texts, whatever the study asks.
"""

from __future__ import annotations

from importlib import import_module
from pkgutil import iter_modules
from typing import Any

from ..phrases import too_few
from ..results import Results
from ..story import Part, mentioned, subjects
from ..text import words

MOST_WORDS = 40  # of a verdict


def stories() -> list[Any]:
    """Every story, in order."""
    modules = (import_module(f"{__name__}.{module.name}") for module in iter_modules(__path__))
    return sorted(modules, key=lambda module: module.ORDER)


def story_of(results: Results) -> Any:
    """The study's own story."""
    return next(story for story in stories() if hasattr(story, "QUESTION") and story.applies(results))


def answer(results: Results) -> list[str]:
    """The verdicts of the study's own story; a sentence in their place where no score allows one."""
    if not results.conditions or results.done.empty:
        return ["No cell of the study has a score, so there is no answer."]
    story = story_of(results)
    few = too_few(results) if getattr(story, "TESTS", True) else ""
    verdicts = [verdict for verdict in (few, *story.verdicts(results)) if verdict]
    named = mentioned(results.labels, " ".join(verdicts))
    holes = {
        label for label, name in results.cells if name in results.conditions and not results.is_complete(label, name)
    }
    lost = [label for label in subjects(results) if label in holes or results.baseline in holes]
    if silent := [label for label in lost if label not in named]:
        verdicts[:0] = [f"Nothing is said of {words(silent)}: a score is missing, of a target or of the baseline."]
    return verdicts or ["Too many scores are missing for an answer."]


def parts() -> list[Part]:
    """Every part, those of report.md first, in the order of their file."""
    known = (part for story in stories() for part in getattr(story, "PARTS", ()))
    return sorted(known, key=lambda part: (part.details, part.order))
