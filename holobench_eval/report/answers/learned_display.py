"""Learned display (paper Table 2): how well does a method exploit the network that stands for the display?"""

from __future__ import annotations

from collections.abc import Iterator

from ..data.results import Results
from .comparison import against_baseline, best, floor, rows
from .kind import Kind, subjects
from .prediction import reported


def sentences(results: Results) -> Iterator[str]:
    """The methods against the baseline, as the network predicts, and the published figures."""
    others = subjects(results) or [label for label in results.layout.methods if label != results.layout.baseline]
    yield from filter(None, (against_baseline(results, label) for label in others[:2]))
    yield best(results)
    yield from reported(results)
    yield from floor(results)


KIND = Kind(
    question="How good are the pictures that the learned display predicts?",
    applies=lambda results: results.layout.learned_display is not None and results.layout.measure == "picture",
    sentences=sentences,
    table=rows,
)
