"""Stand-ins for the libraries that compute, for a command that only prints what classes say of themselves."""

from __future__ import annotations

import sys
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from importlib.metadata import entry_points
from typing import Any

HEAVY = frozenset({"torch", "numba", "scipy", "cv2", "tifffile"})


class _Anything(type):
    """Of the class that stands for a library and all in it: it can be derived from, called, and be part of a type."""

    def __getattr__(cls, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return STAND_IN

    def __call__(cls, *args: Any, **kwargs: Any) -> Any:
        return cls if cls is STAND_IN else super().__call__(*args, **kwargs)

    def __or__(cls, _: Any) -> Any:
        return cls


STAND_IN = _Anything("STAND_IN", (), {})


class _Finder(MetaPathFinder, Loader):
    def find_spec(self, fullname: str, path: Any = None, target: Any = None) -> ModuleSpec | None:
        return ModuleSpec(fullname, self, is_package=True) if fullname.partition(".")[0] in HEAVY else None

    def create_module(self, spec: ModuleSpec) -> Any:
        return STAND_IN

    def exec_module(self, module: Any) -> None:
        """Nothing."""


def only_words() -> None:
    """Import stand-ins for ``HEAVY`` from now on: this process computes nothing, and is done in a fourth of the time.

    Not where torch is there already, nor beside plug-ins of other packages, which may need more of it.
    """
    package, kinds = __package__.partition(".")[0], ("methods", "datasets", "displays")
    plugins = (entry.value for kind in kinds for entry in entry_points(group=f"{package}.{kind}"))
    if "torch" not in sys.modules and all(value.startswith(f"{package}.") for value in plugins):
        sys.meta_path.insert(0, _Finder())
