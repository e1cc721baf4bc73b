"""What a cell is, in plain words, and the hash that names it."""

from __future__ import annotations

import ast
import hashlib
import inspect
import json
from functools import lru_cache
from pathlib import Path
from typing import Any

from ..errors import UserError


def canonical(description: Any) -> str:
    """JSON text that depends on the content only: sorted keys, no spaces, ASCII, finite numbers."""
    try:
        return json.dumps(description, sort_keys=True, separators=(",", ":"), ensure_ascii=True, allow_nan=False)
    except (TypeError, ValueError) as error:
        raise UserError(f"not a plain description: {error}; use text, finite numbers, lists and mappings") from error


def digest(description: Any) -> str:
    """sha256 of the canonical text, 64 hexadecimal digits."""
    return hashlib.sha256(canonical(description).encode()).hexdigest()


def params_of(plugin: Any) -> dict[str, Any]:
    """Every parameter of a method or dataset as plain JSON values, defaults included."""
    from pydantic import TypeAdapter

    params: dict[str, Any] = TypeAdapter(type(plugin)).dump_python(plugin, mode="json")
    canonical(params)
    return params


def code_digest(cls: type[Any]) -> str:
    """sha256 of the code that defines a class, without comments and docstrings.

    It covers the files of the class and its bases, and the modules of their own folders that they import relatively
    (``from .losses import ...``, in this package's methods ``from ..wirtinger import ...`` too); other imports are
    not followed. As part of a cell's identity it has cells computed again after a change of the method, but not
    after a change of its documentation.
    """
    return digest(sorted(code_of(cls).values()))


def code_of(cls: type[Any]) -> dict[Path, str]:
    """The files that define a class, as ``code_digest`` covers them, each in one normal form."""
    members = [member for base in cls.__mro__ for member in vars(base).values()]
    functions = [inspect.unwrap(member) for member in members if inspect.isfunction(member)]
    files = {Path(function.__code__.co_filename).resolve() for function in functions}
    waiting = {(file, _own_folder(file)) for file in files}
    code: dict[Path, str] = {}
    while waiting:
        file, folder = waiting.pop()
        if file not in code and file.is_file():
            code[file], imported = _code(file, file.stat().st_mtime_ns)
            waiting |= {(other, folder) for other in imported if other.is_relative_to(folder)}
    return code


def _own_folder(file: Path) -> Path:
    """The folder whose modules count as a file's own: its own, or that of all the methods that come with the package.

    It holds the same files in every kind of installation, which is not so of the folders above.
    """
    from .. import methods

    shipped = Path(methods.__file__).resolve().parent
    return shipped if file.is_relative_to(shipped) else file.parent


REGISTRATION = ("circles", "genuine", "grid", "refine", "registration", "subpixel", "warp")
"""Modules of ``capture`` that every score depends on."""


@lru_cache(maxsize=256)
def _code(file: Path, _modified: int) -> tuple[str, frozenset[Path]]:
    """A file's code in one normal form, and the files it may import relatively; cached until it is modified."""
    tree = ast.parse(file.read_text(encoding="utf-8"))
    imported: set[Path] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and ast.get_docstring(node) is not None:
            node.body = node.body[1:] or [ast.Pass()]
        if isinstance(node, ast.ImportFrom) and 0 < node.level <= len(file.parents):
            place = file.parents[node.level - 1].joinpath(*(node.module or "").split("."))
            for module in (place, *(place / alias.name for alias in node.names)):
                imported |= {module.parent / f"{module.name}.py", module / "__init__.py"}
    return ast.unparse(tree), frozenset(imported)


@lru_cache(maxsize=1)
def harness_digest() -> str:
    """SHA-256 of the code between a phase and its score: a record of another simulator is another record.

    Comments and docstrings of modules, classes and functions do not count; nor do drivers and the exchange of files
    with a real bench.
    """
    package = Path(__file__).parents[1]
    folders = [package / name for name in ("optics", "display", "metrics")]
    files = [file for folder in folders for file in folder.rglob("*.py")]
    files = sorted([*files, *(package / "capture" / f"{name}.py" for name in REGISTRATION)])
    return digest([_code(file, file.stat().st_mtime_ns)[0] for file in files])
