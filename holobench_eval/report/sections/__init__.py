"""The sections of report.md: each is a file with its tables, sentences and figures, and a line here."""

from __future__ import annotations

from importlib import import_module

from ..section import Section

NAMES = (
    "display.error_budget",
    "setup",
    "findings",
    "results",
    "leaderboard",
    "sweeps",
    "ranks",
    "focus",
    "comparison",
    "training",
    "display.diagnosis",
    "targets",
    "metrics",
    "alignment",
    "cost",
    "appendix",
)


def sections() -> list[Section]:
    """Every section, in the order of the report; a file of small ones holds several."""
    files = (import_module(f"{__name__}.{name}") for name in NAMES)
    return sorted((section for file in files for section in file.SECTIONS), key=lambda section: section.order)
