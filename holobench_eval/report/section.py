"""Until all sections are stories: their old names."""

from typing import Any

from .story import Blocks as Blocks
from .story import Figures as Figures
from .story import Part
from .story import Report as Report


def Section(name: str, *given: Any, **named: Any) -> Part:  # noqa: N802
    """A part with a name that is no more."""
    part = Part(*given, **named)
    object.__setattr__(part, "name", name)
    return part
