"""A JSON schema of a dataclass that files are checked by: its keys and no others, with a text for each."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import is_dataclass
from typing import Any, get_args, get_type_hints

from pydantic import TypeAdapter

from .parameters import meanings

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
    known, hints, fields = meanings(cls), get_type_hints(cls), cls.__dataclass_fields__
    properties = schema.setdefault("properties", {})
    for name in [name for name in properties if not fields[name].metadata.get("key", True)]:
        del properties[name]
    for name, entry in properties.items():
        entry["description"] = known.get(name, "")
        for nested, part in zip(_dataclasses(hints[name]), _objects(entry, definitions), strict=False):
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
