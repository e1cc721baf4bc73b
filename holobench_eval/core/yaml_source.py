"""YAML with positions: every value knows the line and column it came from, so an error can point at it.

The subset is that of the YAML 1.2 core schema (``yes`` is text, ``1e-3`` is a number), without aliases, tags
of other kinds, duplicate keys or numbers that are not finite.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import yaml

from .errors import UserError
from .io import CONTROLS, read_regular

LARGEST_BYTES = 1_000_000
DEEPEST = 20

_CORE = "tag:yaml.org,2002:"

Keys = tuple[str | int, ...]  # where a value is: `("methods", 2, "params")`


class Position(NamedTuple):
    """Line and column, counted from one."""

    line: int
    column: int


@dataclass(frozen=True)
class Document:
    """A YAML mapping as plain Python values, and where each of them stands.

    name: the path as the user gave it; text: the file's contents; keys, values: positions of every mapping
    key and of every value; options: the option of the command line behind a value that is not in the file.
    """

    name: str
    text: str
    data: dict[str, Any]
    keys: dict[Keys, Position]
    values: dict[Keys, Position]
    options: dict[Keys, str] = field(default_factory=dict)

    def error(self, where: Keys, message: str, at_key: bool = False) -> UserError:
        """An error at a value (or at its key), or at the nearest enclosing value that is in the file."""
        positions = self.keys if at_key and where in self.keys else self.values
        while where not in positions:
            where = where[:-1]
        line, column = positions[where]
        return UserError(f"{self.options.get(where) or f'{self.name}:{line}:{column}'}: {message}")


def load(path: Path) -> Document:
    """Read a YAML file that holds a mapping.

    Parameters
    ----------
    path : Path
        The file, of at most `LARGEST_BYTES` in UTF-8.

    Returns
    -------
    Document
        Its values, and where each of them stands.

    Raises
    ------
    UserError
        The first fault in one line, with its line and column where it has any.

    Examples
    --------
    >>> parse("note.yaml", "name: leto").data
    {'name': 'leto'}
    """
    return parse(str(path), _read(path))


def _read(path: Path) -> str:
    try:
        return read_regular(path, LARGEST_BYTES).decode("utf-8")
    except (FileNotFoundError, NotADirectoryError):
        where = "" if path.is_absolute() else f" in {Path.cwd()}"
        raise UserError(f"{path}: no such file{where}") from None
    except OSError as error:
        raise UserError(f"{path}: cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise UserError(
            f"{path}: no YAML, since not UTF-8 text (byte {error.start}); expected a YAML file, saved as UTF-8"
        ) from error


@lru_cache(maxsize=128)  # one study names a profile in many places, and a family of profiles shares its base
def parse(name: str, text: str) -> Document:
    """The document in a text, which callers do not change; ``name`` is used in error lines."""
    reader = _Reader(name)
    try:
        root = _Loader(text).get_single_node()
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        place = "1:1" if mark is None else f"{mark.line + 1}:{mark.column + 1}"
        fault = " ".join(", ".join(part for part in (error.context, error.problem) if part).split())
        if "'\\t'" in fault:
            fault = "a tab, which YAML does not take here; use spaces"
        raise UserError(f"{name}:{place}: {fault}") from error
    except yaml.YAMLError as error:
        raise UserError(f"{name}: not YAML: {' '.join(str(error).split())}") from error
    if not isinstance(root, yaml.MappingNode):
        fault = "is empty" if root is None else "is not a mapping"
        raise UserError(f"{name}:1:1: the file {fault}; expected 'key: value' lines")
    data = reader.value(root, ())
    return Document(name, text, data, reader.keys, reader.values)


class _Loader(yaml.SafeLoader):
    """Composes nodes only: plain scalars resolve as in YAML 1.2, aliases are refused, depth is limited."""

    _depth = 0

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        is_alias = self.check_event(yaml.AliasEvent)
        if is_alias or self._depth == DEEPEST:
            mark = self.peek_event().start_mark  # type: ignore[no-untyped-call]
            fault = "aliases (*name) are not allowed; write the value out"
            raise yaml.MarkedYAMLError(None, None, fault if is_alias else f"nested deeper than {DEEPEST} levels", mark)
        self._depth += 1
        node: yaml.Node | None = super().compose_node(parent, index)
        self._depth -= 1
        return node


_Loader.yaml_implicit_resolvers = {}
for _kind, _pattern, _first in (
    ("null", r"(?:~|null|Null|NULL|)", ["~", "n", "N", ""]),
    ("bool", r"(?:true|True|TRUE|false|False|FALSE)", list("tTfF")),
    ("int", r"[-+]?[0-9]+", list("-+0123456789")),
    ("float", r"[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?", list("-+.0123456789")),
    ("float", r"(?:[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN))", list("-+.")),
):
    _Loader.add_implicit_resolver(_CORE + _kind, re.compile(f"^{_pattern}$"), _first)


class _Dumper(yaml.SafeDumper):
    """Puts quotes around each text that `parse` would take for something else."""


_Dumper.yaml_implicit_resolvers = _Loader.yaml_implicit_resolvers


def dump(data: Mapping[str, Any]) -> str:
    """A mapping of plain values as YAML, from which `parse` reads the same."""
    return yaml.dump(data, Dumper=_Dumper, sort_keys=False, default_flow_style=None, allow_unicode=True, width=118)


class _Reader:
    """Turns nodes into Python values and remembers their positions."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.keys: dict[Keys, Position] = {}
        self.values: dict[Keys, Position] = {}

    def value(self, node: yaml.Node, where: Keys) -> Any:
        """The node as a plain value; its position is noted under ``where``."""
        self.values[where] = _position(node)
        if isinstance(node, yaml.MappingNode) and node.tag == _CORE + "map":
            return self._mapping(node, where)
        if isinstance(node, yaml.SequenceNode) and node.tag == _CORE + "seq":
            return [self.value(item, (*where, index)) for index, item in enumerate(node.value)]
        return self._scalar(node)

    def _mapping(self, node: yaml.MappingNode, where: Keys) -> dict[str, Any]:
        result: dict[str, Any] = {}
        for key_node, value_node in node.value:
            if not isinstance(key_node, yaml.ScalarNode):
                raise self._error(key_node, "a key must be a plain word")
            key = self._text(key_node)
            if key in result:
                first = self.keys[(*where, key)]
                raise self._error(key_node, f"duplicate key '{key}'; first given in line {first.line}")
            self.keys[(*where, key)] = _position(key_node)
            result[key] = self.value(value_node, (*where, key))
        return result

    def _scalar(self, node: yaml.Node) -> Any:
        text = self._text(node)
        try:
            match node.tag.removeprefix(_CORE):
                case "str":
                    return text
                case "null":
                    return None
                case "bool":
                    return {"true": True, "false": False}[text.lower()]
                case "int":
                    return int(text)
                case "float" if math.isfinite(number := float(text)):
                    return number
                case "float":
                    raise ValueError
        except (ValueError, KeyError):
            raise self._error(node, f"'{text[:40]}' is not a finite number or a boolean") from None
        raise self._error(node, f"values of the kind '{node.tag}' are not allowed")

    def _text(self, node: yaml.Node) -> str:
        text = str(node.value)
        if CONTROLS.search(text.replace("\n", "").replace("\t", "")):
            raise self._error(node, f"{text[:40]!r} holds control characters; take them out")
        return text

    def _error(self, node: yaml.Node, message: str) -> UserError:
        line, column = _position(node)
        return UserError(f"{self.name}:{line}:{column}: {message}")


def _position(node: yaml.Node) -> Position:
    return Position(node.start_mark.line + 1, node.start_mark.column + 1)
