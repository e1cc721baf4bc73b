"""What a row of a table says of its method beside its numbers, computed from the records."""

from __future__ import annotations

from collections.abc import Iterator

from ...study.plan import REFERENCE
from .results import Results
from .text import words

CONSTANT = "floor_constant"


def marked(results: Results, label: str, condition: str) -> str:
    """A method's label with what must be known of its row: an oracle, a fallback, a network that learned too little."""
    return ", ".join([results.layout.marked(label), *_marks(results, label, condition)])


def counted(results: Results, label: str, condition: str) -> str:
    """``marked``, and how many targets have a score where that is not all: for tables without a column of that."""
    scored, total = results.row(label, condition)["n"], len(results.targets)
    return f"{marked(results, label, condition)}{f', {scored:.0f} of {total} targets' * bool(scored < total)}"


def _marks(results: Results, label: str, condition: str) -> Iterator[str]:
    cells = results.cells(label, condition)
    if "fell_back" in cells and (cells["fell_back"] != "").any():
        yield "fell back to Wirtinger"
    if results.layout.measure == "prediction" and (below := _below(results, label, condition)):
        yield f"not trained to convergence: below {words(below)}"


def _below(results: Results, label: str, condition: str) -> list[str]:
    """What predicts the captures better than a trained method though it takes no training."""
    layout = results.layout
    if label not in layout.trained - layout.identities or not results.is_complete(label, condition):
        return []
    rows = [("the ideal image", name, condition) for name in layout.identities if name in results.methods(condition)]
    if CONSTANT in results.floors and results.has_floor(condition):
        rows.insert(0, ("the constant image", CONSTANT, REFERENCE))
    ours, better = results.values(label, condition).mean(), results.headline.better
    return [text for text, name, where in rows if better(results.values(name, where).mean(), ours)]
