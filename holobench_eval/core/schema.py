"""A YAML document as a frozen dataclass: unknown keys, wrong types and bad numbers become one line with a place."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import fields, is_dataclass
from typing import Any, TypeVar, get_args, get_type_hints

from .errors import UserError, suggest
from .yaml_source import Document, Keys

T = TypeVar("T")


def dotted(where: Keys) -> str:
    """``methods[2].params`` for a place in a document."""
    parts = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in where)
    return parts.lstrip(".") or "the document"


def check_keys(document: Document, cls: Any, data: Any, where: Keys = ()) -> None:
    """Refuse keys that are no fields of ``cls`` or of the dataclasses nested in it."""
    if isinstance(data, list):
        for index, item in enumerate(data):
            check_keys(document, cls, item, (*where, index))
    if not isinstance(data, dict):
        return
    hints = get_type_hints(cls, include_extras=False)
    allowed = [item.name for item in fields(cls) if item.metadata.get("key", True)]
    for key, value in data.items():
        if key not in allowed:
            message = f"unknown key '{key}' in {dotted(where)}; {suggest(key, allowed)}"
            raise document.error((*where, key), message, at_key=True)
        nested = next((part for part in (hints[key], *get_args(hints[key])) if is_dataclass(part)), None)
        if nested is not None:
            check_keys(document, nested, value, (*where, key))


def typed(document: Document, cls: type[T], data: Mapping[str, Any] | None = None) -> T:
    """``data`` (by default the whole document) as an instance of ``cls``, with types and ranges checked."""
    from pydantic import TypeAdapter, ValidationError

    try:
        text = json.dumps(document.data if data is None else data)
        return TypeAdapter(cls).validate_json(text, strict=True)
    except ValidationError as error:
        first = error.errors()[0]
        raise document.error(first["loc"], _message(first["loc"], first)) from None


def _message(where: Keys, fault: Mapping[str, Any]) -> str:
    if fault["type"] == "missing" and isinstance(where[-1], str):
        return f"missing key '{where[-1]}' in {dotted(where[:-1])}"
    if fault["type"] == "missing":
        return f"{dotted(where[:-1])} has too few values: {fault['input']}"
    message = str(fault["msg"]).replace("Input should", "should")
    for ours, theirs in (
        ("a list", "a valid array"),
        ("a mapping", "an object"),
        ("a whole number", "a valid integer"),
    ):
        message = message.replace(theirs, ours)
    return f"{dotted(where)} {message[0].lower()}{message[1:]}, got {json.dumps(fault['input'])[:60]}"


@contextmanager
def placed(document: Document, name: Keys, params: Keys) -> Iterator[None]:
    """Put a place before an error of the registry: the parameter it names if any, else the plug-in's name."""
    try:
        yield
    except UserError as error:
        named = re.search(r"parameter '([^'.]+)", str(error))
        where = (*params, named[1]) if named and (*params, named[1]) in document.keys else name
        raise document.error(where, str(error), at_key="has no parameter" in str(error)) from error
