"""What a study's records answer to its question: a file for each kind of study, and a line here."""

from __future__ import annotations

from ..results import Results
from . import ablation, budget, comparison, error_budget, focus, over_displays, prediction, ranks, sweeps
from .kind import Kind

# The first that applies answers; a comparison of methods is what any study is.
KINDS = (
    error_budget.KIND,
    comparison.ON_A_NETWORK,
    prediction.KIND,
    focus.KIND,
    ranks.KIND,
    sweeps.KIND,
    over_displays.KIND,
    ablation.KIND,
    budget.KIND,
    comparison.KIND,
)


def kind_of(results: Results) -> Kind:
    """The kind of a study."""
    return next(kind for kind in KINDS if kind.applies(results))
