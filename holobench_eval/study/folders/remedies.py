"""What to do about pictures without a score, by what is at fault: target, file or photograph."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from ...imaging.align import PLAIN, RESIZE
from .files import named
from .pairing import SAVE_TARGET

AT_TARGET = (PLAIN, RESIZE, SAVE_TARGET)
IN_FILE = "; save the"  # what a refusal says where a file has to be saved otherwise

Hole = tuple[str, str, str, str]  # state, method, target, reason


def remedies(holes: Iterable[Hole]) -> str:
    """What to do about each kind of hole, in one sentence; empty where there is no hole."""
    kinds: dict[str, list[tuple[str, str]]] = {}
    for state, method, target, reason in holes:
        kinds.setdefault(_kind(state, reason), []).append((method, target))
    found = "; ".join(_by_kind(kinds))
    return f"{found[:1].upper()}{found[1:]}." if found else ""


def _by_kind(kinds: dict[str, list[tuple[str, str]]]) -> Iterator[str]:
    if at_target := list(dict.fromkeys(target for _, target in kinds.get("target", []))):
        which = f"target{'s' * (len(at_target) > 1)} {named(at_target)}"
        yield f"save or choose the {which} anew, whose fault it is and not the captures', as the reasons say"
    if in_file := [f"{method}/{target}" for method, target in kinds.get("file", [])]:
        yield f"save {named(in_file)} anew, as the reasons say"
    if kinds.get("photograph"):
        yield "take the failed captures again, or name them by what they show"
    if kinds.get("missing"):
        yield "add the captures that are missing"


def _kind(state: str, reason: str) -> str:
    if state == "missing":
        return "missing"
    if any(text in reason for text in AT_TARGET):
        return "target"
    return "file" if IN_FILE in reason else "photograph"
