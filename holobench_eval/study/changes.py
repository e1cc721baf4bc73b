"""What the command line changes in a config: some of its methods and targets, and single values."""

from __future__ import annotations

import copy
import shlex
from collections.abc import Callable, Container, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Annotated, Any

from annotated_types import Interval

from ..core.errors import UserError, listed, suggest
from ..core.schema import checked
from ..core.yaml_source import Document, Keys, Position, parse


@dataclass(frozen=True)
class Changes:
    """methods, targets: labels (or names) and names to keep, none for all; limit: how many targets to keep, the first
    ones; values: ``key=value``, with a dotted path as the key, or a method's label, a dot and its parameter."""

    methods: tuple[str, ...] = ()
    targets: tuple[str, ...] = ()
    limit: Annotated[int, Interval(ge=1)] | None = None
    values: tuple[str, ...] = ()

    def __bool__(self) -> bool:
        return self != Changes()

    def __str__(self) -> str:
        """As options of the command line."""
        limit = () if self.limit is None else (str(self.limit),)
        given = {"--methods": self.methods, "--targets": self.targets, "--limit": limit, "--set": self.values}
        return shlex.join([part for option, texts in given.items() for text in texts for part in (option, text)])


def recorded(provenance: Mapping[str, Any]) -> Changes:
    """The changes that a run was made with. UserError for a damaged provenance."""
    return checked(Changes, provenance.get("changes", {}))


def noted(changes: Changes) -> dict[str, Any]:
    """What `recorded` reads; empty without changes."""
    return {"changes": {key: value for key, value in asdict(changes).items() if value}} if changes else {}


def changed(document: Document, changes: Changes, keys: Container[str]) -> Document:
    """A config with the values of the changes; a fault in one is then told at its option.

    keys: those of a config. UserError: a key that leads nowhere, or a value that is no YAML.
    """
    for text in changes.values:
        document = with_value(document, text, keys.__contains__)
    return replace(document, text=f"# changed by {changes}\n{document.text}") if changes else document


def chosen(option: str, texts: Sequence[str], allowed: Sequence[str], what: str) -> list[str]:
    """The names in the texts of an option, each a name or several with commas between. UserError: an unknown one."""
    names = []
    for text in texts:
        parts = [text] if text in allowed else [part.strip() for part in text.split(",") if part.strip()]
        for part in parts or [text]:
            if part not in allowed:
                raise UserError(f"{option} {part}: no such {what}; {suggest(part, allowed)}")
            names.append(part)
    return names


def with_value(document: Document, text: str, known: Callable[[str], bool], of_each: bool = False) -> Document:
    """A document with the value of a text ``key=value``. UserError as `changed`.

    The key is a dotted path, or the label (else the name) of methods, a dot and their parameter. known: whether a word
    may begin another key; of_each: whether such a key is a parameter of each method.
    """
    key, equals, value = text.partition("=")
    place, first = f"--set {text}", key.partition(".")[0]
    if not equals or not all(key.split(".")):
        raise UserError(f"{place}: expected key=value, with dots between nested keys")
    methods: list[dict[str, Any]] = []
    if isinstance(given := document.data.get("methods"), list):
        methods = [each if isinstance(each, dict) else {"name": each} for each in given]
        document = replace(document, data={**document.data, "methods": methods})
    names = [str(each.get("name")) for each in methods]
    labels = [str(each.get("label") or name.rpartition(":")[2]) for each, name in zip(methods, names, strict=True)]
    called = [] if not of_each and known(first) else [*labels, *names]
    begun = max((name for name in called if key.startswith(f"{name}.")), key=len, default="")
    if not begun and "." in key and not known(first):
        raise UserError(f"{place}: no method '{first}' among {listed(labels)}, and no key of this name")
    called = labels if begun in labels else names
    rows = [row for row, name in enumerate(called) if name == begun or (of_each and not begun)]
    for own in [f"methods.{row}.params.{key.removeprefix(f'{begun}.')}" for row in rows] or [key]:
        document = _with(document, own, _value(value, place), place)
    return document


def _with(document: Document, key: str, value: Any, place: str) -> Document:
    """A document with a value at a dotted path."""
    path: Keys = ()
    data = copy.deepcopy(document.data)
    inner: Any = data
    *parents, last = key.split(".")
    for part in parents:
        path = (*path, _key(inner, part, place, path))
        if isinstance(inner, dict):
            inner.setdefault(part, {})
        inner = inner[path[-1]]
    path = (*path, _key(inner, last, place, path))
    inner[path[-1]] = value
    known = document.values
    new = [path[:depth] for depth in range(1, len(path) + 1) if path[:depth] not in known]
    replaced = [where for where in known if where[: len(path)] == path]
    places = dict.fromkeys(new, Position(1, 1))
    options = document.options | dict.fromkeys([*new, *replaced], place)
    return replace(document, data=data, keys=places | document.keys, values=places | known, options=options)


def _key(inner: Any, part: str, place: str, path: Keys) -> str | int:
    """A part of a dotted path as the key of a mapping or the index of a list."""
    if isinstance(inner, dict):
        return part
    where = ".".join(map(str, path))
    if not isinstance(inner, list):
        raise UserError(f"{place}: '{where}' is a single value and has no '{part}'")
    if not part.isdecimal() or int(part) >= len(inner):
        raise UserError(f"{place}: '{where}' is a list; give a number from 0 to {len(inner) - 1} in place of '{part}'")
    return int(part)


def _value(text: str, place: str) -> Any:
    try:
        data = parse("", f"value: {text}").data
    except UserError as error:
        raise UserError(f"{place}: {str(error).partition(': ')[2]}") from None
    if set(data) != {"value"}:
        raise UserError(f"{place}: more than one value")
    return data["value"]
