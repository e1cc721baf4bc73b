"""Which version of the code a number comes from: declared for what ships with the package, a hash for users' files.

A declared version does not depend on where code lies or how it is written. ``tests/golden`` computes a small case of
everything that is declared here and fails where its numbers have changed and its version has not.
"""

from __future__ import annotations

import ast
import inspect
from functools import lru_cache
from pathlib import Path
from typing import Any

from ..core.hashing import digest

# Everything between a phase and its score: optics, simulated bench, registration, metrics. A new version is any new
# text; every cell is then computed again.
HARNESS = "4: scattered light taken off before registration"
# How photographs of a display that exists are scored, beside HARNESS: one new text for a real display's cells alone.
PHOTOGRAPHS = "means over the target's pixels"
# The alignment of a photograph with its target without fiducials (``holoeval score``).
ALIGNMENT = "levels are counted where a capture shows its target"

# Names of versions in records that are older than declared versions; a method that is not listed is named by its own.
RECORDED = {
    "DoublePhase 1": "43150a62afdb18a7a813171a6289847a0866ad081d8bcb2e08cf5b82ef738669",
    "AntiAliasedDoublePhase 1": "43150a62afdb18a7a813171a6289847a0866ad081d8bcb2e08cf5b82ef738669",
    "BandLimitedDoublePhase 1": "43150a62afdb18a7a813171a6289847a0866ad081d8bcb2e08cf5b82ef738669",
    "Wirtinger 1": "ff9985aba9a67073893cebe3126f64efc98cce850790e272124a331884c8f1e1",
    "AmplitudeSGD 1": "8ee8643d0aa6b897f2f0f1cb09a5483ac327de9ba520a3b6ff700c67051a4008",
    "OnlineCameraNetwork 1": "bce152c23936f80c4c37fe77c9a8c6a0810f2e25f61dc994e082e573667997f5",
    "OdakSGD 1": "2d9d2d697aed0c8479e93e71bb82ad99955bb6c28539a24e5d58259090a249a9",
    "TorchOpticsAdam 1": "0d28d9a38415f3f296c42991f0f668f26524a6822e603554025f1b1e5d936fa5",
}


def method_version(cls: type[Any]) -> str:
    """The version of a method's code in a cell: declared if it ships with the package, else ``code_digest``.

    A shipped method declares ``version: ClassVar[int]``, 1 if it says nothing. It is raised when the method gives
    other phases, or learns something else: cells that use it are then computed, and artifacts learned, again.
    """
    if "code_version" in vars(cls):  # of a method in a process of its own, which told it
        return str(vars(cls)["code_version"])
    if not _ships(cls):
        return code_digest(cls)
    declared = f"{cls.__qualname__} {getattr(cls, 'version', 1)}"
    return RECORDED.get(declared, declared)


def code_digest(cls: type[Any]) -> str:
    """sha256 of the code that defines a user's class, without comments and docstrings.

    It covers the files of the class and its bases, and the modules of their own folders that they import relatively
    (``from .losses import ...``); other imports are not followed. As part of a cell's identity it has cells computed
    again after a change of the method, but not after a change of its documentation. Bases that ship with the package
    count by their declared versions.
    """
    code = sorted(code_of(cls).values())
    shipped = [method_version(base) for base in cls.__mro__ if _ships(base)]
    return digest([*code, *shipped]) if code or not shipped else shipped[0]


def code_of(cls: type[Any]) -> dict[Path, str]:
    """The files that define a class, as ``code_digest`` covers them, each in one normal form."""
    members = [member for base in cls.__mro__ if not _ships(base) for member in vars(base).values()]
    functions = [inspect.unwrap(member) for member in members if inspect.isfunction(member)]
    files = {Path(function.__code__.co_filename).resolve() for function in functions}
    waiting = {(file, file.parent) for file in files}
    code: dict[Path, str] = {}
    while waiting:
        file, folder = waiting.pop()
        if file not in code and file.is_file():
            code[file], imported = _code(file, file.read_text(encoding="utf-8"))
            waiting |= {(other, folder) for other in imported if other.is_relative_to(folder)}
    return code


def _ships(cls: type[Any]) -> bool:
    return cls.__module__.startswith("holobench_eval.")


@lru_cache(maxsize=256)
def _code(file: Path, text: str) -> tuple[str, frozenset[Path]]:
    """The code of a file in one normal form, and the files it may import relatively."""
    tree = ast.parse(text)
    imported: set[Path] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and ast.get_docstring(node) is not None:
            node.body = node.body[1:] or [ast.Pass()]
        if isinstance(node, ast.ImportFrom) and 0 < node.level <= len(file.parents):
            package = file.parents[node.level - 1].joinpath(*(node.module or "").split("."))
            for module in (package, *(package / alias.name for alias in node.names)):
                imported |= {module.parent / f"{module.name}.py", module / "__init__.py"}
    return ast.unparse(tree), frozenset(imported)
