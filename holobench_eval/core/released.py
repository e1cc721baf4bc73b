"""Whether the methods and datasets of this package are as they were released, in a clone where all can be edited.

``released.json`` has a digest for each of their files and those of the optics: of the code alone, without comments and
docstrings. ``python -m tests.golden.released`` writes it.
"""

from __future__ import annotations

import ast
import json
from collections.abc import Callable, Iterable
from contextlib import suppress
from functools import cache, lru_cache
from importlib.util import find_spec, resolve_name
from pathlib import Path
from typing import Any

from .hashing import State, digest, file_state
from .reads import PACKAGE

FILE = Path(__file__).with_name("released.json")
PARTS = tuple(f"{PACKAGE}.{part}" for part in ("methods", "datasets", "optics"))


def edited(modules: Iterable[str]) -> str:
    """A digest of the files of ``PARTS`` that modules use and that differ from the released ones; empty for none."""
    files = used(modules, lambda name: name.startswith(PARTS))
    differing = {name: code_digest(file) for name, file in files.items() if code_digest(file) != digests().get(name)}
    return digest(differing)[:12] if differing else ""


def used(modules: Iterable[str], counts: Callable[[str], bool]) -> dict[str, Path]:
    """The files of modules, and of those that they import, at once or later; counts: which of their names do."""
    waiting, files = list(modules), dict[str, Path]()
    while waiting:
        name = waiting.pop()
        if name not in files and counts(name) and (file := file_of(name)) is not None:
            files[name] = file
            waiting += [name.rpartition(".")[0], *imports(file, name)]
    return files


def code_digest(file: Path) -> str:
    """A digest of the code in a Python file, the same in all versions of Python."""
    return _read(file, file_state(file))[0]


def imports(file: Path, module: str = "") -> list[str]:
    """The modules that a Python file may import, at once or later. module: its name, where relative ones start."""
    package = module if file.name == "__init__.py" else module.rpartition(".")[0]
    named = [f"{'.' * level}{name}" for level, name in _read(file, file_state(file))[1]]
    return [resolve_name(name, package) for name in named if package or not name.startswith(".")]


@lru_cache(maxsize=2**10)
def _read(file: Path, _state: State | None) -> tuple[str, list[tuple[int, str]]]:
    try:
        tree = ast.parse(file.read_bytes())
    except (SyntaxError, ValueError, OSError):
        return "", []
    names = list[tuple[int, str]]()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names += [(0, alias.name) for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            dot = "." if node.module else ""
            names += [(node.level, f"{node.module or ''}{dot}{alias.name}") for alias in node.names]
            names += [(node.level, node.module)] if node.module else []
    return digest(_plain(tree))[:16], names


def _plain(node: Any) -> Any:
    if isinstance(node, ast.AST):
        return [
            type(node).__name__,
            *([name, _plain(value)] for name, value in ast.iter_fields(node) if value not in (None, [])),
        ]
    if isinstance(node, list):
        texts = (isinstance(item, ast.Expr) and isinstance(item.value, ast.Constant) for item in node)
        return [_plain(item) for item, is_text in zip(node, texts, strict=True) if not is_text]
    return repr(node)


@lru_cache(maxsize=2**10)
def file_of(name: str) -> Path | None:
    """The Python file of a module; None where a name is none, or a module of C."""
    with suppress(Exception):  # of the import of a package that holds it
        spec = find_spec(name)
        return Path(spec.origin) if spec is not None and spec.has_location and spec.origin else None
    return None


@cache
def digests() -> dict[str, str]:
    """The digest of each released file, by its module."""
    released: dict[str, str] = json.loads(FILE.read_text(encoding="utf-8"))
    return released
