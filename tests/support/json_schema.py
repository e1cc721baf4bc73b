"""As much of JSON Schema 2020-12 as the schema of configs uses; another keyword is an error."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

TYPES: dict[str, Any] = {"object": dict, "array": list, "string": str, "boolean": bool, "null": type(None)}
REMARKS = {"description", "default", "$schema", "$defs", "title", "format", "then"}


def faults(value: Any, schema: Any, root: Any, where: str = "") -> Iterator[str]:
    """What is wrong with a value, a line a fault."""
    for keyword, given in schema.items():
        if keyword not in REMARKS:
            yield from _CHECKS[keyword](value, given, schema, root, where)


def _type(value: Any, given: Any, *rest: Any) -> Iterator[str]:
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    fits = {"number": is_number, "integer": is_number and value == int(value)}
    if not fits.get(given, isinstance(value, TYPES.get(given, ()))):
        yield f"{rest[-1]}: is no {given}"


def _number(keyword: str, wrong: Any) -> Any:
    def check(value: Any, given: Any, schema: Any, root: Any, where: str) -> Iterator[str]:
        if isinstance(value, int | float) and not isinstance(value, bool) and wrong(value, given):
            yield f"{where}: {keyword} {given}"

    return check


def _length(keyword: str, kind: type, wrong: Any) -> Any:
    def check(value: Any, given: Any, schema: Any, root: Any, where: str) -> Iterator[str]:
        if isinstance(value, kind) and wrong(len(value), given):  # type: ignore[arg-type]
            yield f"{where}: {keyword} {given}"

    return check


def _properties(value: Any, given: Any, schema: Any, root: Any, where: str) -> Iterator[str]:
    for key in set(given) & set(value if isinstance(value, dict) else ()):
        yield from faults(value[key], given[key], root, f"{where}.{key}")


def _others(value: Any, given: Any, schema: Any, root: Any, where: str) -> Iterator[str]:
    others = set(value) - set(schema.get("properties", ())) if isinstance(value, dict) else ()
    for key in others:
        if given is False:
            yield f"{where}: unknown key {key}"
        elif isinstance(given, dict):
            yield from faults(value[key], given, root, f"{where}.{key}")


def _items(value: Any, given: Any, schema: Any, root: Any, where: str) -> Iterator[str]:
    for index, item in enumerate(value if isinstance(value, list) else ()):
        part = given[index] if isinstance(given, list) and index < len(given) else given
        if isinstance(part, dict):
            yield from faults(item, part, root, f"{where}[{index}]")


def _how_many(wrong: Any) -> Any:
    def check(value: Any, given: Any, schema: Any, root: Any, where: str) -> Iterator[str]:
        fits = sum(not any(faults(value, part, root, where)) for part in given)
        if wrong(fits, len(given)):
            yield f"{where}: {fits} of {len(given)} choices fit"

    return check


def _required(value: Any, given: Any, schema: Any, root: Any, where: str) -> Iterator[str]:
    for key in given if isinstance(value, dict) else ():
        if key not in value:
            yield f"{where}: needs {key}"


def _if(value: Any, given: Any, schema: Any, root: Any, where: str) -> Iterator[str]:
    if not any(faults(value, given, root, where)):
        yield from faults(value, schema["then"], root, where)


def _all(value: Any, given: Any, schema: Any, root: Any, where: str) -> Iterator[str]:
    for part in given:
        yield from faults(value, part, root, where)


def _reference(value: Any, given: Any, schema: Any, root: Any, where: str) -> Iterator[str]:
    yield from faults(value, root["$defs"][given.removeprefix("#/$defs/")], root, where)


def _equal(value: Any, given: Any, schema: Any, root: Any, where: str) -> Iterator[str]:
    if value not in (given if isinstance(given, list) else [given]):
        yield f"{where}: {value} is not {given}"


def _pattern(value: Any, given: Any, schema: Any, root: Any, where: str) -> Iterator[str]:
    if isinstance(value, str) and not re.search(given, value):
        yield f"{where}: does not match {given}"


_CHECKS: dict[str, Any] = {
    "$ref": _reference,
    "type": _type,
    "enum": _equal,
    "const": _equal,
    "pattern": _pattern,
    "properties": _properties,
    "additionalProperties": _others,
    "required": _required,
    "items": _items,
    "prefixItems": _items,
    "anyOf": _how_many(lambda fits, total: fits == 0),
    "oneOf": _how_many(lambda fits, total: fits != 1),
    "allOf": _all,
    "if": _if,
    "minimum": _number("minimum", lambda value, given: value < given),
    "maximum": _number("maximum", lambda value, given: value > given),
    "exclusiveMinimum": _number("exclusiveMinimum", lambda value, given: value <= given),
    "exclusiveMaximum": _number("exclusiveMaximum", lambda value, given: value >= given),
    "minLength": _length("minLength", str, lambda length, given: length < given),
    "minItems": _length("minItems", list, lambda length, given: length < given),
    "maxItems": _length("maxItems", list, lambda length, given: length > given),
}
