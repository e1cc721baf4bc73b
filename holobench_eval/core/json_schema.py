"""A JSON schema of a dataclass that files are checked by: its keys and no others, with a text for each.

Texts come from the description of a field or from the docstrings of the class and its bases, in numpy's form
(``Parameters``) or as ``name: meaning; other: meaning``.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator, Mapping
from dataclasses import is_dataclass
from typing import Any, get_args, get_type_hints

from pydantic import TypeAdapter

Schema = dict[str, Any]

REFERENCE = "#/$defs/{model}"


def json_schemas(classes: Mapping[str, type[Any]]) -> tuple[dict[str, Schema], Schema]:
    """The schema of each dataclass by its name in the mapping, and the definitions that they share."""
    adapters: Any = [(name, "validation", TypeAdapter(cls)) for name, cls in classes.items()]
    found, shared = TypeAdapter.json_schemas(adapters, ref_template=REFERENCE)
    definitions: Schema = shared.get("$defs", {})
    schemas = {name: found[name, "validation"] for name in classes}
    done: set[int] = set()
    for name, cls in classes.items():
        _complete(cls, schemas[name], definitions, done)
    for schema in (*schemas.values(), *definitions.values()):
        _untitled(schema)
    return schemas, definitions


def resolved(schema: Schema, definitions: Schema) -> Schema:
    """The schema behind a reference."""
    return definitions[schema["$ref"].rpartition("/")[2]] if "$ref" in schema else schema


def _complete(cls: type[Any], schema: Schema, definitions: Schema, done: set[int]) -> None:
    """Give the keys of a dataclass their texts, refuse all others, and go on with the dataclasses in it."""
    schema = resolved(schema, definitions)
    if id(schema) in done:
        return
    done.add(id(schema))
    known, fields = meanings(cls), cls.__dataclass_fields__
    properties = schema.setdefault("properties", {})
    for name in [name for name in properties if not fields[name].metadata.get("key", True)]:
        del properties[name]
    for name, entry in properties.items():
        entry["description"] = entry.get("description") or known.get(name, "")
        if parts := list(_objects(entry, definitions)):  # annotations may name what is imported for types alone
            for nested, part in zip(_dataclasses(get_type_hints(cls)[name]), parts, strict=False):
                _complete(nested, part, definitions, done)
    schema["additionalProperties"] = False
    schema.pop("description", None)


def _dataclasses(hint: Any) -> Iterator[type[Any]]:
    """The dataclasses in an annotation."""
    if is_dataclass(hint):
        yield hint  # type: ignore[misc]
    for part in get_args(hint):
        yield from _dataclasses(part)


def _objects(entry: Any, definitions: Schema) -> Iterator[Schema]:
    """The mappings with keys of their own in a value's schema."""
    if isinstance(entry, Mapping):
        if "$ref" in entry and "properties" in resolved(dict(entry), definitions):
            yield resolved(dict(entry), definitions)
        for part in entry.values():
            yield from _objects(part, definitions)
    elif isinstance(entry, list):
        for part in entry:
            yield from _objects(part, definitions)


def _untitled(schema: Any) -> None:
    """Without the titles that pydantic makes of names."""
    parts = list(schema.values()) if isinstance(schema, dict) else schema if isinstance(schema, list) else []
    if isinstance(schema, dict) and isinstance(schema.get("title"), str):
        del schema["title"]
    for part in parts:
        _untitled(part)


def meanings(cls: type[Any]) -> dict[str, str]:
    """What docstrings say of the fields of a dataclass, by name; those of its bases where its own says nothing."""
    found: dict[str, str] = {}
    fields = list(getattr(cls, "__dataclass_fields__", {}))
    for base in cls.__mro__:
        text = inspect.cleandoc(base.__doc__ or "")
        for name, meaning in {**_inline(text, fields), **_numpy(text)}.items():
            if name in fields and meaning:
                found.setdefault(name, meaning)
    return found


def plain(text: str) -> str:
    """A text in one line, without signs of markup."""
    return re.sub(r"::$", ":", " ".join(text.replace("`", "").split()))


def _numpy(text: str) -> dict[str, str]:
    """Meanings in a section ``Parameters``, where several names may share an entry."""
    section = re.search(r"\nParameters\n-+\n(.*?)(?=\n\n\w+\n-{3,}\n|\Z)", f"\n{text}", re.DOTALL)
    found = {}
    for names, meaning in (
        re.findall(r"^(\w[\w, ]*?)(?: :[^\n]*)?\n((?:[ \t]+[^\n]*\n?|\n)+)", section[1] + "\n", re.M) if section else ()
    ):
        found.update(dict.fromkeys(re.split(r",\s*", names), plain(meaning)))
    return found


def _inline(text: str, fields: list[str]) -> dict[str, str]:
    """Meanings as ``name: meaning; other, another: meaning``, each at most to the end of its paragraph."""
    if not fields:
        return {}
    name = rf"(?:{'|'.join(fields)})"
    found = {}
    for paragraph in text.split("\n\n"):
        flat = " ".join(paragraph.split())
        parts = re.split(rf"(?:^|(?<=[.;:)] ))({name}(?:, {name})*): ", flat)
        for names, meaning in zip(parts[1::2], parts[2::2], strict=True):
            found.update(dict.fromkeys(names.split(", "), plain(meaning).rstrip(".; ")))
    return found
