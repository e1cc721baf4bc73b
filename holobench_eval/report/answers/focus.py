"""Focus: one hologram of all planes of a scene against one hologram a plane, moved by a lens phase."""

from __future__ import annotations

from collections.abc import Iterator

from ..data.board import Board
from ..data.phrases import difference, marked, tested, verdict
from ..data.results import Results
from ..data.text import number
from ..markdown import Markdown, table
from .kind import Kind, subjects


def verdicts(results: Results) -> Iterator[str]:
    """One a display: the methods that make one hologram of all planes, or that the question names."""
    layout, score = results.layout, results.headline
    chosen = dict.fromkeys([*(label for label in layout.methods if label in layout.stacked), *subjects(results)])
    for condition in results.conditions:
        parts = []
        for label in chosen:
            if test := tested(results, label, condition):
                what = ", one hologram of all planes," if label in layout.stacked else ""
                shown = {"better": "", "worse": ""}.get(verdict(score, test), ", not shown")
                parts.append(
                    f"{label}{what} {difference(score, test.estimate)} against {test.first}{shown}, "
                    f"{_times(results, label, condition)}"
                )
        if parts:
            yield f"{condition}: {'; '.join(parts)}."


def _planes(results: Results) -> int:
    return len({plane for _, plane in results.layout.planes.values()})


def _seconds(results: Results, label: str, condition: str) -> float:
    """Computing time of a scene [s]."""
    times = 1 if label in results.layout.stacked else _planes(results)
    return times * float(results.row(label, condition)["solving_s"])


def _times(results: Results, label: str, condition: str) -> str:
    own, other = (_seconds(results, name, condition) for name in (label, str(results.layout.baseline)))
    return f"{own / other:.2g} times its seconds a scene"


def _against(results: Results, label: str, condition: str) -> str:
    test = tested(results, label, condition)
    return results.headline.estimate(test.estimate, signed=True) if test else "–"


def rows(board: Board) -> Markdown | None:
    """A row a method and display: score over all planes, difference to the baseline, seconds a scene."""
    results = board.results
    score, baseline = results.headline, results.layout.baseline
    lines = [
        [
            marked(results, label, condition),
            condition,
            "all planes" if label in results.layout.stacked else "one plane",
            score.in_row(results.row(label, condition)),
            *([_against(results, label, condition)] if baseline else []),
            number(_seconds(results, label, condition)),
        ]
        for condition in results.conditions
        for label in results.methods(condition)
    ]
    against = [f"difference to {baseline}"] if baseline else []
    headings = ["method", "display", "hologram of", score.heading, *against, "seconds a scene"]
    return table(headings, lines) if lines else None


KIND = Kind(
    question="What does one hologram of all planes gain over one hologram a plane, and what does it cost?",
    applies=lambda results: bool(results.layout.planes),
    verdicts=verdicts,
    table=rows,
    limits=(
        "Scenes: the planes of a scene are not independent, so intervals and tests are over scenes, which are few.",
    ),
)
