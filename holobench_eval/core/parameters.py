"""The parameters of a dataclass: as a JSON schema that files are checked by, and in words.

The schema has the keys of the dataclass and no others, with a text for each: from the description of a field or from
the docstrings of the class and its bases, in numpy's form (``Parameters``) or as ``name: meaning; other: meaning``. The
words say what each parameter may be, what it is without being given, and what it means.
"""

from __future__ import annotations

import inspect
import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from pydantic import TypeAdapter
from pydantic.json_schema import GenerateJsonSchema
from pydantic_core.core_schema import DataclassSchema

Schema = dict[str, Any]

REFERENCE = "#/$defs/{model}"
_WORDS = {"integer": "whole number", "boolean": "true or false", "string": "text", "null": "null", "object": "mapping"}
_NONE_GIVEN = "needed"
LARGEST = 1e15  # above it a maximum is that of the machine, and not said


def json_schemas(classes: Mapping[str, type[Any]]) -> tuple[dict[str, Schema], Schema]:
    """The schema of each dataclass by its name in the mapping, and the definitions that they share."""
    adapters: Any = [(name, "validation", TypeAdapter(cls)) for name, cls in classes.items()]
    found, shared = TypeAdapter.json_schemas(adapters, ref_template=REFERENCE, schema_generator=_Schemas)
    return {name: found[name, "validation"] for name in classes}, shared.get("$defs", {})


class _Schemas(GenerateJsonSchema):
    """As pydantic's, but a dataclass has its keys alone, with their texts, and no titles are made of names."""

    def dataclass_schema(self, schema: DataclassSchema) -> Schema:
        """The schema of a dataclass, which refuses keys that it has not."""
        made, cls = super().dataclass_schema(schema), schema["cls"]
        known, fields = meanings(cls), cls.__dataclass_fields__
        properties = made.setdefault("properties", {})
        for name in [name for name in properties if not fields[name].metadata.get("key", True)]:
            del properties[name]
        for name, entry in properties.items():
            entry["description"] = entry.get("description") or known.get(name, "")
        del made["title"]
        made.pop("description", None)
        return made | {"additionalProperties": False}

    def field_title_should_be_set(self, schema: Any) -> bool:
        """No."""
        return False


def resolved(schema: Schema, definitions: Schema) -> Schema:
    """The schema behind a reference."""
    return definitions[schema["$ref"].rpartition("/")[2]] if "$ref" in schema else schema


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


@dataclass(frozen=True)
class Parameter:
    """A parameter: its name (of one inside another with a dot), its default, what it may be, and its meaning."""

    name: str
    default: str
    allowed: str
    meaning: str


@dataclass(frozen=True)
class Words:
    """What a class says of itself: see ``summary``, ``source`` and ``parameters``."""

    summary: str
    source: str
    parameters: list[Parameter]


def words(cls: type[Any]) -> Words:
    """What a dataclass says of itself."""
    return Words(summary(cls), source(cls), parameters(cls))


def parameters(cls: type[Any]) -> list[Parameter]:
    """Every parameter of a dataclass, those of dataclasses in it after their own.

    Examples
    --------
    >>> from dataclasses import dataclass
    >>> @dataclass(frozen=True)
    ... class Lamp:
    ...     \"\"\"A lamp.
    ...
    ...     power: of its light [W]; name: of the lamp.
    ...     \"\"\"
    ...     power: float = 1.0
    ...     name: str = "desk"
    >>> for parameter in parameters(Lamp):
    ...     print(parameter.name, parameter.default, parameter.allowed, parameter.meaning, sep=" | ")
    power | 1.0 | number | of its light [W]
    name | desk | text | of the lamp
    """
    schemas, definitions = json_schemas({"": cls})
    return list(_entries(resolved(schemas[""], definitions), definitions, "", None))


def _entries(schema: Schema, definitions: Schema, prefix: str, given: Any) -> Iterator[Parameter]:
    for name, entry in schema.get("properties", {}).items():
        default = entry.get("default", _NONE_GIVEN if name in schema.get("required", ()) else {})
        default = given[name] if isinstance(given, Mapping) and name in given else default
        inner = _mapping(entry, definitions)
        meaning = entry.get("description", "")
        if "properties" in inner:
            optional = "anyOf" in entry
            null = "null" if optional and default is None else ""
            yield Parameter(f"{prefix}{name}", null, "null or a mapping of:" if optional else "mapping of:", meaning)
            yield from _entries(inner, definitions, f"{prefix}{name}.", default)
        else:
            text = default if isinstance(default, str) else json.dumps(default)
            yield Parameter(f"{prefix}{name}", text, allowed(entry, definitions), meaning)


def _mapping(entry: Schema, definitions: Schema) -> Schema:
    """The schema of a value that is a mapping, or may be one beside null; else that of the value."""
    parts = [resolved(part, definitions) for part in entry.get("anyOf", ())]
    mappings = [part for part in parts if "properties" in part]
    others = [part for part in parts if part not in mappings and part.get("type") != "null"]
    return mappings[0] if len(mappings) == 1 and not others else resolved(entry, definitions)


def allowed(entry: Schema, definitions: Schema) -> str:
    """What a value may be, in words: ``whole number from 1 to 100``."""
    entry = resolved(entry, definitions)
    if "anyOf" in entry:
        return " or ".join(dict.fromkeys(allowed(part, definitions) for part in entry["anyOf"]))
    if "enum" in entry or "const" in entry:
        return " or ".join(map(str, entry.get("enum", [entry.get("const")])))
    kind = str(entry.get("type", ""))
    if kind == "array":
        items = entry.get("items") or entry.get("prefixItems", [{}])[0]
        count = f"{entry['minItems']} values" if entry.get("minItems") == entry.get("maxItems", -1) else "list"
        return f"{count}, each {allowed(items, definitions)}" if items else count
    if kind == "object" and isinstance(entry.get("additionalProperties"), Mapping):
        return f"mapping of names to {allowed(entry['additionalProperties'], definitions)}"
    return f"{_WORDS.get(kind, kind or 'any value')}{_range(entry)}"


def _range(entry: Schema) -> str:
    entry = {key: value for key, value in entry.items() if key != "maximum" or value < LARGEST}
    if "minimum" in entry and "maximum" in entry:
        return f" from {entry['minimum']:g} to {entry['maximum']:g}"
    words = {"minimum": "at least", "exclusiveMinimum": "above", "maximum": "at most", "exclusiveMaximum": "below"}
    parts = [f"{word} {entry[key]:g}" for key, word in words.items() if key in entry]
    return f" {', '.join(parts)}" if parts else ""


def summary(cls: type[Any]) -> str:
    """A docstring as far as it is about the class, without sections and signs of markup, a line a paragraph."""
    text = inspect.cleandoc(cls.__doc__ or "")
    text = re.split(r"\n\n\w+\n-{3,}\n", text)[0]
    fields = list(getattr(cls, "__dataclass_fields__", {}))
    paragraphs = [
        one for one in text.split("\n\n") if not re.match(rf"(?:{'|'.join(fields) or '-'})(?:,[^:]*)?: ", one)
    ]
    return "\n\n".join(plain(one) for one in paragraphs)


def source(cls: type[Any]) -> str:
    """The paper behind a class: the paragraphs of its file's docstring, after the first, that name a year; or empty."""
    module = inspect.getmodule(cls)
    paragraphs = inspect.cleandoc((module and module.__doc__) or "").split("\n\n")[1:]
    return " ".join(plain(one) for one in paragraphs if re.search(r"\b(?:19|20)\d\d\b", one))
