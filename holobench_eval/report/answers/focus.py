"""Focal stacks and light fields: one hologram of all planes or views of a scene against what knows of one."""

from __future__ import annotations

from collections.abc import Iterator

from ..data.board import Board
from ..data.phrases import difference, marked, tested, value, verdict
from ..data.results import Results
from ..data.text import number
from ..markdown import Markdown, table_of
from ..story import subjects
from .kind import Kind


def verdicts(results: Results) -> Iterator[str]:
    """One a display: the methods that receive all planes or views, or that the question names, best first."""
    layout, score = results.layout, results.headline
    chosen = dict.fromkeys([*(label for label in layout.methods if label in layout.stacked), *subjects(results)])
    for condition in results.conditions:
        found = [(label, test) for label in chosen if (test := tested(results, label, condition))]
        found.sort(key=lambda each: each[1].estimate.mean, reverse=score.higher_is_better)
        parts = [
            f"{label} (of {made_of(results, label)}) {difference(score, test.estimate)}"
            + ("" if verdict(score, test) in ("better", "worse") else ", not shown")
            for label, test in found
        ]
        if parts:
            yield f"{condition}, against {layout.baseline}: {'; '.join(parts)}."
        elif rows := results.methods(condition):
            yield f"{condition}: {'; '.join(f'{label} {value(results, label, condition)}' for label in rows)}."


def made_of(results: Results, label: str) -> str:
    """What a hologram of a method is made of."""
    part = {"focus": ("all planes", "one plane"), "views": ("all views", "the middle view")}[results.layout.measure]
    return part[0] if label in results.layout.stacked else part[1]


def seconds(results: Results, label: str, condition: str) -> float:
    """Computing time of a scene [s]."""
    once = label in results.layout.stacked or results.layout.measure == "views"
    holograms = 1 if once else len({plane for _, plane in results.layout.planes.values()})
    return holograms * float(results.row(label, condition)["solving_s"])


def rows(board: Board) -> Markdown | None:
    """A row a method and display: score over all planes or views, difference to the baseline, seconds a scene."""
    results = board.results
    score, baseline = results.headline, results.layout.baseline
    lines = []
    for label, condition in ((label, name) for name in results.conditions for label in results.methods(name)):
        line = {"method": marked(results, label, condition), "display": condition}
        line |= {"hologram of": made_of(results, label), score.heading: score.in_row(results.row(label, condition))}
        if baseline:
            test = tested(results, label, condition)
            line[f"difference to {baseline}"] = score.estimate(test.estimate if test else None, signed=True)
        lines.append(line | {"seconds a scene": number(seconds(results, label, condition))})
    return table_of(lines)


KIND = Kind(
    question="What does a hologram of all planes or views of a scene gain over that of one, and what does it cost?",
    applies=lambda results: bool(results.layout.planes),
    verdicts=verdicts,
    table=rows,
    limits=(
        "Scenes: the planes or views of a scene are not independent, so intervals and tests are over scenes, which are "
        "few.",
    ),
)
