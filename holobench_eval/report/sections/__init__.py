"""The sections of report.md and details.md: each is a file with its tables, sentences and figures, and a line here."""

from __future__ import annotations

from importlib import import_module

from ..section import Section

NAMES = ("answer", "overview", "setup", "sweeps", "ranks", "focus", "training", "diagnosis", "tests", "alignment")


def sections() -> list[Section]:
    """Every section, those of report.md first, in the order of their file; a module of small ones holds several."""
    files = (import_module(f"{__name__}.{name}") for name in NAMES)
    return sorted(
        (section for file in files for section in file.SECTIONS), key=lambda section: (section.details, section.order)
    )
