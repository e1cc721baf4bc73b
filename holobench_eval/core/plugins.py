"""Find methods and datasets by name: entry points for installed packages, ``path/to/file.py:Class`` for the rest."""

from __future__ import annotations

import hashlib
import importlib.util
import json
import sys
from dataclasses import fields, is_dataclass
from functools import cache, lru_cache
from importlib.machinery import SourceFileLoader
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from types import CodeType
from typing import Any, Literal, get_args, get_type_hints

from pydantic import TypeAdapter, ValidationError

from .errors import UserError, suggest
from .hashing import canonical

Kind = Literal["methods", "datasets"]


@lru_cache
def _entries(kind: Kind) -> dict[str, EntryPoint]:
    """Looked up once: that reads a file of every installed package."""
    return {entry.name: entry for entry in entry_points(group=f"holobench_eval.{kind}")}


def names(kind: Kind) -> list[str]:
    """The registered names, sorted."""
    return sorted(_entries(kind))


def find(kind: Kind, name: str, folder: Path | None = None) -> type[Any]:
    """The class registered as ``name``, or the class in a file when ``name`` is ``path/to/file.py:Class``.

    A relative path is taken from ``folder`` (the folder of the config that names it) first, then from the
    working directory.
    """
    if _is_file(name):
        return _from_file(kind, name, folder)
    entries = _entries(kind)
    if name not in entries:
        raise UserError(f"unknown {kind[:-1]} '{name}'; {suggest(name, entries)}, or path/to/file.py:Class")
    try:
        return _checked(kind, name, entries[name].load())
    except (ImportError, AttributeError) as error:
        raise UserError(f"{kind[:-1]} '{name}' cannot be imported: {error}") from error


def _is_file(name: str) -> bool:
    return ".py:" in name


class _FromSource(SourceFileLoader):
    """Compiles a file anew for every import.

    Cached bytecode is valid for a source of the same size and the same second, so a file that is rewritten within a
    second would run as it was before.
    """

    def get_code(self, fullname: str) -> CodeType:
        return self.source_to_code(self.get_data(self.path), self.path)


def _from_file(kind: Kind, name: str, folder: Path | None) -> type[Any]:
    file, _, attribute = name.rpartition(":")
    candidates = [Path(file)] if folder is None else [folder / file, Path(file)]
    path = next((path for path in candidates if path.is_file()), None)
    if path is None:
        raise UserError(f"{kind[:-1]} '{name}': no such file: {candidates[0]}")
    # the name differs from path to path, and the module is registered since dataclasses look their module up
    unique = hashlib.sha256(str(path.resolve()).encode()).hexdigest()[:12]
    unique = f"holobench_user_{path.stem}_{unique}"
    spec = importlib.util.spec_from_file_location(unique, path, loader=_FromSource(unique, str(path)))
    if spec is None or spec.loader is None:
        raise UserError(f"{kind[:-1]} '{name}': {path} is no Python file")
    module = importlib.util.module_from_spec(spec)  # anew each time: no cell may depend on those computed before it
    sys.modules[spec.name] = module
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:
        raise UserError(f"{kind[:-1]} '{name}': the file fails to import: {type(error).__name__}: {error}") from error
    found = getattr(module, attribute, None)
    if found is None:
        classes = [key for key, value in vars(module).items() if isinstance(value, type) and is_dataclass(value)]
        raise UserError(f"{kind[:-1]} '{name}': {path} has no class '{attribute}'; {suggest(attribute, classes)}")
    return _checked(kind, name, found)


def _checked(kind: Kind, name: str, found: Any) -> type[Any]:
    needed = "solve" if kind == "methods" else "items"
    if not (isinstance(found, type) and is_dataclass(found) and hasattr(found, needed)):
        raise UserError(f"{kind[:-1]} '{name}' is not a dataclass with a method '{needed}'; see CONTRIBUTING.md")
    return found


def _check_nested(who: str, cls: type[Any], params: dict[str, Any], place: str) -> None:
    """Refuse keys of nested parameters that are no fields of the dataclass they are for; pydantic would drop them."""
    mappings = {key: value for key, value in params.items() if isinstance(value, dict)}
    hints = get_type_hints(cls) if mappings else {}  # a tenth of a millisecond, for every cell
    for key, value in mappings.items():
        nested = [part for part in (hints.get(key), *get_args(hints.get(key))) if isinstance(part, type)]
        inner = next((part for part in nested if is_dataclass(part)), None)
        if inner is None:
            continue
        allowed = [item.name for item in fields(inner)]
        for name in value:
            if name not in allowed:
                raise UserError(f"{who} has no parameter '{place}{key}.{name}'; {suggest(name, allowed)}")
        _check_nested(who, inner, value, f"{place}{key}.")


@cache
def _kept_adapter(kind: Kind, name: str) -> TypeAdapter[Any]:
    """Of an installed class: a file's is made anew with each import, and would be kept for ever."""
    return TypeAdapter(find(kind, name))


def build(kind: Kind, name: str, params: dict[str, Any], folder: Path | None = None) -> Any:
    """An instance with validated parameters; a wrong key, type or range is one line naming the parameter."""
    cls = find(kind, name, folder)
    known = set(cls.__dataclass_fields__)
    for key in params:
        if key not in known:
            raise UserError(f"{kind[:-1]} '{name}' has no parameter '{key}'; {suggest(key, known)}")
    _check_nested(f"{kind[:-1]} '{name}'", cls, params, "")
    try:
        adapter: TypeAdapter[Any] = TypeAdapter(cls) if _is_file(name) else _kept_adapter(kind, name)
        return adapter.validate_json(json.dumps(params), strict=True)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"])
        message = first["msg"][:1].lower() + first["msg"][1:]
        raise UserError(f"{kind[:-1]} '{name}': parameter '{where}': {message}, got {first['input']!r}") from error
    except UserError:
        raise
    except Exception as error:  # whatever a stranger's class does when it is built
        reason = f"{type(error).__name__}: {error}".splitlines()[0]
        raise UserError(f"{kind[:-1]} '{name}' cannot be built: {reason}") from error


def params_of(plugin: Any) -> dict[str, Any]:
    """Every parameter of a method or dataset as plain JSON values, defaults included."""
    params: dict[str, Any] = TypeAdapter(type(plugin)).dump_python(plugin, mode="json")
    canonical(params)
    return params
