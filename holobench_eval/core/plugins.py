"""Find methods and datasets by name: entry points for installed packages, ``path/to/file.py:Name`` for the rest."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import MISSING, field, fields, is_dataclass, make_dataclass, replace
from functools import cache, lru_cache, wraps
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Any, Literal, get_type_hints

from pydantic import TypeAdapter

from . import sources
from .errors import UserError, reason, suggest
from .hashing import canonical
from .schema import checked

Kind = Literal["methods", "datasets"]
KINDS: tuple[Kind, ...] = ("methods", "datasets")


@lru_cache
def _entries(kind: Kind) -> dict[str, EntryPoint]:
    """Looked up once: that reads a file of every installed package."""
    return {entry.name: entry for entry in entry_points(group=f"holobench_eval.{kind}")}


def names(kind: Kind) -> list[str]:
    """The registered names, sorted."""
    return sorted(_entries(kind))


def find(kind: Kind, name: str, folder: Path | None = None) -> type[Any]:
    """Find the class of a method or a dataset.

    Parameters
    ----------
    kind : {"methods", "datasets"}
        What it is.
    name : str
        The name of an entry point, or ``path/to/file.py:Name`` of a class, or of a method's function.
    folder : Path, optional
        Where a relative path starts (the folder of the config that names it); the working directory is tried after it.

    Returns
    -------
    type
        A dataclass; for a function ``solve(target, bench, ...)`` one that has its further parameters.

    Raises
    ------
    UserError
        An unknown name, a file that fails to import, or a class that is no method or dataset.

    Examples
    --------
    >>> find("datasets", "charts").__name__
    'Charts'
    """
    if is_file(name):
        return _from_file(kind, name, folder)
    entries = _entries(kind)
    if name.endswith(".py"):
        raise UserError(f"{kind[:-1]} '{name}': a file without its class; expected {name}:Class")
    if name not in entries:
        raise UserError(f"unknown {kind[:-1]} '{name}'; {suggest(name, entries)}, or path/to/file.py:Name")
    try:
        with nullcontext() if is_shipped(kind, name) else sources.imports_recorded():
            loaded = entries[name].load()
        return _plugin_class(kind, name, loaded)
    except (ImportError, AttributeError) as error:
        raise UserError(f"{kind[:-1]} '{name}' cannot be imported: {error}") from error


def is_shipped(kind: Kind, name: str) -> bool:
    """Whether a plug-in's code is that of this package; nothing is imported for the answer."""
    if is_file(name) or name not in _entries(kind):
        return False
    return _entries(kind)[name].value.startswith(f"{__package__.partition('.')[0]}.")


def is_registered(kind: Kind, cls: type[Any]) -> bool:
    """Whether a class is itself a plug-in of this package, which then has a version of its own."""
    value = f"{cls.__module__}:{cls.__qualname__}"
    return any(entry.value == value and is_shipped(kind, name) for name, entry in _entries(kind).items())


def is_file(name: str) -> bool:
    """Whether a name is that of a file and its class."""
    return ".py:" in name


def _from_file(kind: Kind, name: str, folder: Path | None) -> type[Any]:
    file, _, attribute = name.rpartition(":")
    candidates = [Path(file)] if folder is None else [folder / file, Path(file)]
    path = next((path for path in candidates if path.is_file()), None)
    if path is None:
        raise UserError(f"{kind[:-1]} '{name}': no such file: {candidates[0]}")
    try:
        module, code = sources.import_class(path, attribute, folder)
    except (Exception, SystemExit) as error:
        raise UserError(f"{kind[:-1]} '{name}': the file fails to import: {reason(error)}") from error
    cls = getattr(module, attribute, None)
    if cls is None:
        own = {key: value for key, value in vars(module).items() if getattr(value, "__module__", "") == module.__name__}
        near = [key for key, value in own.items() if is_dataclass(value) or _is_function(kind, value)]
        raise UserError(f"{kind[:-1]} '{name}': {path} has no '{attribute}'; {suggest(attribute, near)}")
    found = _plugin_class(kind, name, cls)
    if not sources.is_fresh(found):  # from elsewhere, and the same one for all files that name it
        derive: Any = type(found)
        found = derive(found.__name__, (found,), {"__module__": module.__name__, "__doc__": found.__doc__})
    sources.remember(found, replace(code, bases=(*code.bases, *sources.bases_of(found))))
    return found


def _plugin_class(kind: Kind, name: str, found: Any) -> type[Any]:
    if kind == "methods":
        refuse_swapped(found, f"method '{name}'")
    if _is_function(kind, found):
        return _class_of(found, f"{kind[:-1]} '{name}'")
    function = "solve" if kind == "methods" else "items"
    if not (isinstance(found, type) and is_dataclass(found) and hasattr(found, function)):
        other = "neither a function of target and bench, nor" if kind == "methods" else "not"
        own = f"; its parameters are {inspect.signature(found)}" if inspect.isfunction(found) else ""
        raise UserError(f"{kind[:-1]} '{name}' is {other} a dataclass with a method '{function}'{own}")
    return found


def refuse_swapped(method: Any, owner: str) -> None:
    """UserError for a method, or its class or function, that takes bench and target by these names in this order."""
    try:
        # of a method's own function, not of one that it wraps
        parameters = inspect.signature(getattr(method, "solve", method), follow_wrapped=False).parameters
    except (TypeError, ValueError):  # it is not called, or is one of C, which does not tell
        return
    if [name for name in parameters if name != "self"][:2] == ["bench", "target"]:
        raise UserError(f"{owner} takes bench and target in this order; expected (target, bench)")


def _is_function(kind: Kind, found: Any) -> bool:
    return kind == "methods" and inspect.isfunction(found) and len(inspect.signature(found).parameters) >= 2


def _class_of(function: Callable[..., Any], owner: str) -> type[Any]:
    """The dataclass of a method that is a function of target and bench. Its further parameters are the fields; what is
    set on the function, such as ``camera = True``, is declared by the class, functions as static methods."""
    try:
        fields = fields_of(function, owner, 2)

        @wraps(function)
        def solve(self: Any, target: Any, bench: Any) -> Any:
            return function(target, bench, **{name: getattr(self, name) for name, *_ in fields})

        own = {name: staticmethod(value) if callable(value) else value for name, value in vars(function).items()}
        declared = {**own, "solve": solve, "__doc__": function.__doc__}
        cls = make_dataclass(function.__name__, fields, frozen=True, namespace=declared)
    except (TypeError, ValueError, NameError) as error:
        raise UserError(f"{owner}: its parameters cannot be taken from a config: {error}") from error
    cls.__module__, cls.__qualname__ = function.__module__, function.__qualname__
    return cls


def fields_of(function: Callable[..., Any], owner: str, skipped: int = 0) -> list[tuple[str, Any, Any]]:
    """The parameters of a function or a class as fields of a dataclass, but for the first ones that are skipped.

    UserError for one that no file can give; NameError or TypeError where its annotation cannot be evaluated.
    """
    further = list(inspect.signature(function).parameters.values())[skipped:]
    for given in further:
        if given.kind in (given.VAR_POSITIONAL, given.VAR_KEYWORD):
            raise UserError(f"{owner}: '{given}' takes any parameters; name each of them")
        if given.annotation is given.empty and given.default is given.empty:
            raise UserError(f"{owner}: parameter '{given.name}' needs an annotation or a default")
    own: Any = vars(function).get("__init__", function) if isinstance(function, type) else function
    hints = get_type_hints(own, include_extras=True)
    defaults = [MISSING if each.default is each.empty else each.default for each in further]
    return [
        (each.name, hints.get(each.name, type(each.default)), field(default=default))
        for each, default in zip(further, defaults, strict=True)
    ]


@cache
def _kept_adapter(kind: Kind, name: str) -> TypeAdapter[Any]:
    """Of an installed class: a file's is made anew with each import, and would be kept for ever."""
    return TypeAdapter(find(kind, name))


def build(kind: Kind, name: str, params: dict[str, Any], folder: Path | None = None) -> Any:
    """Build a method or a dataset.

    Parameters
    ----------
    kind, name, folder
        As in `find`.
    params : dict
        Its parameters, as a config gives them.

    Returns
    -------
    object
        An instance, with keys, types and ranges of its parameters checked; one with a function ``in_folder`` is told
        where the paths of its parameters start.

    Raises
    ------
    UserError
        A wrong key, type or range, in one line that names the parameter (`schema.FieldError`), or whatever the class
        itself refuses.

    Examples
    --------
    >>> build("methods", "gerchberg_saxton", {"iterations": 5}).iterations
    5
    """
    cls = find(kind, name, folder)
    built = made(cls, f"{kind[:-1]} '{name}'", params, None if is_file(name) else _kept_adapter(kind, name))
    return built.in_folder(folder) if folder is not None and hasattr(cls, "in_folder") else built


def made(cls: type[Any], owner: str, params: dict[str, Any], adapter: TypeAdapter[Any] | None = None) -> Any:
    """An instance of a plug-in's class, checked as by `build`. owner: what error messages call it."""
    try:
        return checked(cls, params, owner, adapter)
    except UserError:
        raise
    except Exception as error:  # whatever a stranger's class does when it is built
        first = f"{type(error).__name__}: {error}".splitlines()[0]
        raise UserError(f"{owner} cannot be built: {first}") from error


LATER = {"later": True}
"""Metadata of a parameter that came after results were kept: with its default it is in no name, so they keep theirs."""


def params_of(plugin: Any) -> dict[str, Any]:
    """Every parameter of a method or dataset as plain JSON values, defaults included but for those of ``LATER``."""
    params: dict[str, Any] = TypeAdapter(type(plugin)).dump_python(plugin, mode="json")
    for item in fields(plugin):
        if item.metadata == LATER and getattr(plugin, item.name) == item.default:
            del params[item.name]
    canonical(params)
    return params
