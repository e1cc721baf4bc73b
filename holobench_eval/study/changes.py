"""What the command line changes in a config: some of its methods and targets, and single values."""

from __future__ import annotations

import copy
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Annotated, Any

from annotated_types import Interval

from ..core.errors import UserError, suggest
from ..core.schema import checked
from ..core.yaml_source import Document, Position, parse


@dataclass(frozen=True)
class Changes:
    """methods, targets: labels (or names) and names to keep, none for all; limit: how many targets to keep, the first
    ones; values: ``key=value``, with a dotted path as the key."""

    methods: tuple[str, ...] = ()
    targets: tuple[str, ...] = ()
    limit: Annotated[int, Interval(ge=1)] | None = None
    values: tuple[str, ...] = ()

    def __bool__(self) -> bool:
        return self != Changes()

    def __str__(self) -> str:
        """As options of the command line."""
        options = [("--methods", text) for text in self.methods] + [("--targets", text) for text in self.targets]
        options += [("--limit", str(self.limit))] * (self.limit is not None)
        options += [("--set", text) for text in self.values]
        return shlex.join([part for option in options for part in option])

    @property
    def note(self) -> str:
        """What a report says of a study that was changed."""
        return f"This is not the whole study of the config, and not its result: it was run with {self}."


def recorded(provenance: Mapping[str, Any]) -> Changes:
    """The changes that a run was made with. UserError for a damaged provenance."""
    return checked(Changes, provenance.get("changes", {}))


def noted(changes: Changes) -> dict[str, Any]:
    """What `recorded` reads; empty without changes."""
    return {"changes": {key: value for key, value in asdict(changes).items() if value}} if changes else {}


def changed(document: Document, changes: Changes) -> Document:
    """A config with the values of the changes; a fault in one is then told at its option.

    UserError: a key that leads nowhere, or a value that is no YAML.
    """
    for text in changes.values:
        document = _with_value(document, text)
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


def _with_value(document: Document, text: str) -> Document:
    key, equals, value = text.partition("=")
    place = f"--set {text}"
    if not equals or not all(key.split(".")):
        raise UserError(f"{place}: expected key=value, such as display.panel=[192, 192] or methods.0.label=mine")
    data, path = copy.deepcopy(document.data), list[str | int]()
    inner: Any = data
    parts = key.split(".")
    for depth, part in enumerate(parts):
        path.append(_key(inner, part, place, path))
        if depth == len(parts) - 1:
            inner[path[-1]] = _value(value, place)
        else:
            if isinstance(inner, dict):
                inner.setdefault(path[-1], {})
            inner = inner[path[-1]]
    keys, values = (
        {where: at for where, at in places.items() if where[: len(path)] != tuple(path)}
        for places in (document.keys, document.values)
    )
    new = [tuple(path[:depth]) for depth in range(1, len(path) + 1)]
    new = [where for where in new if where not in values]
    places = dict.fromkeys(new, Position(1, 1))
    options = document.options | dict.fromkeys(new, place)
    return replace(document, data=data, keys=keys | places, values=values | places, options=options)


def _key(inner: Any, part: str, place: str, path: Sequence[str | int]) -> str | int:
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
        reason = str(error).partition(": ")[2]
        raise UserError(f"{place}: {reason}") from None
    if set(data) != {"value"}:
        raise UserError(f"{place}: more than one value")
    return data["value"]
