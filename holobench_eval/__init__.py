"""holobench_eval: which phase-retrieval method gives the better picture on a real, imperfect display?

From Python: ``open_display``, ``open_bench``, ``score``, ``picture``, ``compare``, ``save_levels`` and
``load_records``, see ``interactive``.
"""

# ruff: noqa: F403, F405 (the list below says which names there are)
from typing import TYPE_CHECKING, Any

from .core.installed import __version__

if TYPE_CHECKING:
    from .interactive import *

__all__ = [
    "OpenDisplay",
    "__version__",
    "compare",
    "load_records",
    "open_bench",
    "open_display",
    "picture",
    "save_levels",
    "score",
]


def __getattr__(name: str) -> Any:
    """The names above, whose libraries take a second to import, when they are first used."""
    if name in __all__:
        from . import interactive

        return getattr(interactive, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
