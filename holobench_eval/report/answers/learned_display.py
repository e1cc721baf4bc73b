"""Learned display (paper Table 2): how well does a method exploit the network that stands for the display?"""

from __future__ import annotations

from .comparison import verdicts
from .kind import Kind

KIND = Kind(
    question="How good are the pictures that the learned display predicts?",
    applies=lambda results: results.layout.learned_display is not None and results.layout.measure == "picture",
    verdicts=verdicts,
)
