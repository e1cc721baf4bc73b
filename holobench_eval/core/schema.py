"""Mappings from files as frozen dataclasses: the first unknown key, wrong type or bad number becomes one line.

Checks of single values say what was meant: lengths in metres, and whatever else is a sentence.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, is_dataclass
from functools import cache
from inspect import signature
from typing import Any, TypeVar, get_args, get_type_hints

from pydantic import TypeAdapter, ValidationError
from pydantic_core.core_schema import no_info_after_validator_function

from .errors import UserError, suggest
from .yaml_source import Document, Keys

T = TypeVar("T")

LONGEST_VALUE, LONGEST_PATH = 60, 100  # characters of a file's own text that an error repeats
KINDS: Mapping[str, frozenset[str]] = {  # of documents, and keys that the others have not
    "a study": frozenset({"methods", "targets", "protocol", "title"}),
    "a real bench": frozenset({"slm", "camera", "capture", "laser", "phase"}),
    "a simulated display": frozenset({"lut", "sensor", "relay", "like", "panel"}),
}
POWERS = (-3, -6, -9)  # of ten: millimetres, micrometres, nanometres
PLAIN_WORDS = (("a list", "a valid array"), ("a mapping", "an object"), ("a whole number", "a valid integer"))


class FieldError(UserError):
    """A fault of one value.

    where: its keys, counted from the mapping that was checked; at_key: the key itself is the fault.
    """

    def __init__(self, where: Keys, message: str, at_key: bool = False) -> None:
        super().__init__(message)
        self.where, self.at_key = where, at_key


def checked(cls: type[T], data: Any, owner: str = "", adapter: TypeAdapter[T] | None = None) -> T:
    """Build a dataclass from a mapping, with keys, types and ranges checked.

    Parameters
    ----------
    cls : type
        A dataclass; fields with the metadata ``{"key": False}`` are no keys.
    data : mapping
        Plain values, as YAML and JSON have them.
    owner : str
        What the values are parameters of, such as ``"method 'hil'"``; empty for the keys of a file.
    adapter : TypeAdapter, optional
        That of ``cls``, where it is kept because making one takes a millisecond.

    Returns
    -------
    object
        An instance of ``cls``.

    Raises
    ------
    FieldError
        The first fault in one line, and where it is.
    UserError
        A value that JSON does not have, or whatever ``cls`` itself refuses.

    Examples
    --------
    >>> from dataclasses import dataclass
    >>> @dataclass(frozen=True)
    ... class Lamp:
    ...     power: float = 1.0
    >>> checked(Lamp, {"power": 2.5}, "lamp 'desk'")
    Lamp(power=2.5)
    >>> checked(Lamp, {"powr": 2.5}, "lamp 'desk'")
    Traceback (most recent call last):
    holobench_eval.core.schema.FieldError: lamp 'desk' has no parameter 'powr'; did you mean 'power'? allowed: power
    """
    for where, allowed in _unknown_keys(cls, [((), data)]):
        raise FieldError(where, _unknown_line(where, allowed, owner), at_key=True)
    try:
        text = json.dumps(data)
    except TypeError as error:  # a value that YAML has and JSON has not, such as a date
        raise UserError(f"{owner or 'the document'}: {error}") from None
    try:
        return (adapter or TypeAdapter(cls)).validate_json(text, strict=True)
    except ValidationError as error:
        where, fault = _deepest(data, error.errors())
        raise FieldError(where, _value_line(where, fault, owner)) from None


_adapter = cache(TypeAdapter)


def typed(document: Document, cls: type[T], data: Mapping[str, Any] | None = None) -> T:
    """Build a dataclass from a YAML document; every fault is told with its place in the file.

    Parameters
    ----------
    document : Document
        As ``yaml_source.load`` returns it.
    cls : type
        A dataclass (see `checked`).
    data : mapping, optional
        What stands for the document's data, for a file that may be written shorter than the dataclass.

    Returns
    -------
    object
        An instance of ``cls``.

    Raises
    ------
    UserError
        ``file:line:column: `` and the first fault.
    """
    try:
        return checked(cls, document.data if data is None else data, adapter=_adapter(cls))  # type: ignore[arg-type]
    except FieldError as error:
        given, wanted = kinds_of(document.data), kinds_of(cls.__dataclass_fields__)  # type: ignore[attr-defined]
        if error.at_key and len(error.where) == 1 and given and wanted and wanted[0] not in given:
            raise document.error((), f"the file describes {given[0]}; expected {wanted[0]}") from None
        raise document.error(error.where, str(error), error.at_key) from None


def kinds_of(keys: Iterable[str]) -> list[str]:
    """What a document with these keys may describe: a study, a real bench or a display."""
    return [kind for kind, marks in KINDS.items() if not marks.isdisjoint(keys)]


@contextmanager
def placed(document: Document, name: Keys, *params: Keys) -> Iterator[None]:
    """Put a place before an error about a plug-in: the parameter at fault if the file gives it, else its name.

    Parameters
    ----------
    document : Document
        The file that names the plug-in.
    name, *params : tuple of str or int
        Where its name stands in the file, and the mappings that may hold its parameters.
    """
    try:
        yield
    except UserError as error:
        field = error.where[:1] if isinstance(error, FieldError) else ()
        where = next((place for part in params if field and (place := (*part, *field)) in document.keys), name)
        raise document.error(where, str(error), at_key=isinstance(error, FieldError) and error.at_key) from error


def _deepest(data: Any, faults: Sequence[Any]) -> tuple[Keys, Any]:
    """The first fault and its place; where a value may be of several kinds, that of the kind which it comes nearest."""
    placed = [(_place(data, fault), fault) for fault in faults]
    first = placed[0][0]
    return max((each for each in placed if each[0][: len(first)] == first), key=lambda each: len(each[0]))


def _place(data: Any, fault: Mapping[str, Any]) -> Keys:
    """The keys of a fault, without the names that pydantic gives to the kinds that a value may be of."""
    where: Keys = ()
    for part in fault["loc"]:
        try:
            data = data[part]
        except (KeyError, IndexError, TypeError):
            continue
        where = (*where, part)
    return (*where, fault["loc"][-1]) if fault["type"] == "missing" else where


def _unknown_keys(cls: Any, mappings: list[tuple[Keys, Any]]) -> Iterator[tuple[Keys, list[str]]]:
    """Keys in ``mappings`` that are no fields of ``cls`` or of the dataclasses nested in it, and what is allowed.

    All mappings of one class are looked at together, since evaluating its annotations takes a tenth of a millisecond.
    """
    mappings = [(where, data) for where, data in mappings if isinstance(data, Mapping)]
    known = cls.__dataclass_fields__
    allowed = [name for name in signature(cls).parameters if name not in known or known[name].metadata.get("key", True)]
    for where, data in mappings:
        yield from (((*where, key), allowed) for key in data if key not in allowed)
    values = [value for _, data in mappings for value in data.values()]
    items = [item for value in values for _, item in _entries((), value)]
    if not any(isinstance(item, Mapping) for item in items):  # annotations may name what is imported for types alone
        return
    for key, hint in get_type_hints(cls).items():
        nested = next((part for part in (hint, *get_args(hint)) if is_dataclass(part)), None)
        if nested is not None:
            given = [((*where, key), data[key]) for where, data in mappings if key in data]
            yield from _unknown_keys(nested, [entry for where, value in given for entry in _entries(where, value)])


def _entries(where: Keys, value: Any) -> Iterable[tuple[Keys, Any]]:
    if isinstance(value, list | tuple):
        return [((*where, index), item) for index, item in enumerate(value)]
    return [(where, value)]


def _unknown_line(where: Keys, allowed: list[str], owner: str) -> str:
    if owner:
        return f"{owner} has no parameter '{_joined(where)}'; {suggest(str(where[-1]), allowed)}"
    key = str(where[-1])[:LONGEST_VALUE]
    return f"unknown key {key!r} in {_dotted(where[:-1])}; {suggest(key, allowed)}"


def _value_line(where: Keys, fault: Mapping[str, Any], owner: str) -> str:
    if fault["type"] == "missing":
        if owner:
            return f"{owner} needs the parameter '{_joined(where)}'"
        if isinstance(where[-1], str):
            return f"missing key '{where[-1]}' in {_dotted(where[:-1])}"
        return f"{_dotted(where[:-1])} has too few values: {str(fault['input'])[:LONGEST_VALUE]}"
    if fault["type"] == "value_error":  # a sentence of our own
        place = f"{owner}: parameter '{_joined(where)}'" if owner else _dotted(where)
        return f"{place}: {fault['ctx']['error']}"
    message = str(fault["msg"])
    for ours, theirs in PLAIN_WORDS:
        message = message.replace(theirs, ours)
    if owner:
        value = repr(fault["input"])[:LONGEST_VALUE]
        return f"{owner}: parameter '{_joined(where)}': {message[0].lower()}{message[1:]}, got {value}"
    message = message.replace("Input should", "should")
    return f"{_dotted(where)} {message[0].lower()}{message[1:]}, got {json.dumps(fault['input'])[:LONGEST_VALUE]}"


def _joined(where: Keys) -> str:
    return ".".join(str(part) for part in where)[:LONGEST_PATH]


def _dotted(where: Keys) -> str:
    """``methods[2].params`` for a place in a document, on one line whatever its keys are."""
    parts = "".join(f"[{part}]" if isinstance(part, int) else f".{repr(part)[1:-1]}" for part in where)
    return parts.lstrip(".")[:LONGEST_PATH] or "the document"


class Check:
    """A mark of an annotated type, which says in words what is wrong with a value."""

    def fault(self, value: Any) -> str:
        """What is wrong with a value of the type; empty for a right one."""
        raise NotImplementedError

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> Any:
        """What pydantic asks for: the check, after those of the type."""
        return no_info_after_validator_function(self._checked, handler(source))

    def _checked(self, value: Any) -> Any:
        if fault := self.fault(value):
            raise ValueError(fault)
        return value


@dataclass(frozen=True)
class Metres(Check):
    """A length in a range [m]; one in another unit is refused with its value in metres.

    Examples
    --------
    >>> Metres(200e-9, 2000e-9).fault(532.0)
    '532 is not in 200e-9 to 2e-6 m; lengths are in metres: 532e-9'
    >>> Metres(1e-3, 10.0).fault(2000000.0)
    '2000000 is not in 1e-3 to 10 m; lengths are in metres: 2000000e-6'
    """

    low: float
    high: float

    def fault(self, value: float) -> str:
        """See ``Check``."""
        if self.low <= value <= self.high:
            return ""
        meant = (power for power in POWERS if self.low <= value * 10.0**power <= self.high)
        remedy = next((f"; lengths are in metres: {value:.10g}e{power}" for power in meant), "")
        return f"{value:.10g} is not in {metres(self.low)} to {metres(self.high)} m{remedy}"

    def __get_pydantic_json_schema__(self, schema: Any, handler: Any) -> Any:
        """What pydantic asks for: the range, for editors and pages."""
        return {**handler(schema), "minimum": self.low, "maximum": self.high}


def metres(value: float) -> str:
    """A length as files have it: ``532e-9``, ``6.4e-6``, ``0.1``.

    Examples
    --------
    >>> metres(5.32e-7), metres(6.4e-6), metres(0.1)
    ('532e-9', '6.4e-6', '0.1')
    """
    power = next((power for power in POWERS if value >= 10.0**power), POWERS[-1])
    return f"{value:g}" if value >= 0.01 else f"{value / 10.0**power:g}e{power}"
