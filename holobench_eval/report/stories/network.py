"""Paper Table 2: how well does a method exploit the network that stands for the display?"""

from __future__ import annotations

from ..results import Results
from .comparison import verdicts as verdicts

ORDER = 20
QUESTION = "How good are the pictures that the learned display predicts?"


def applies(results: Results) -> bool:
    """Whether pictures are scored that a learned display predicts."""
    return bool(results.facts.network) and results.study.measure == "picture"
