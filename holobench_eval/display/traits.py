"""What a method declares about itself, read in one place."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, fields
from typing import Any, Literal, get_args

from ..core.errors import UserError
from .api import DisplaySpec

Function = Literal[
    "solve", "solve_planes", "solve_views", "predict", "prepare", "estimates", "available", "files", "external", "blind"
]
FUNCTIONS: tuple[Function, ...] = get_args(Function)


@dataclass(frozen=True)
class Traits:
    """What the class of a method declares; the defaults are those of a class that declares nothing.

    camera: captures while it solves; privileged: may see the simulated bench; trains: learns first; follows: is solved
    after all others; planes, views: solves all planes of a scene, or views of a light field, at once; fresnel: needs
    the image in a Fresnel plane; form: effects that its model of the display has parameters for; title: its name for
    people; tuned: what its defaults were chosen on; version: of the numbers it gives; timed: False where its seconds
    mean nothing; simulates: its phases depend on the code of the simulated bench; functions: those that it has, of
    which ``blind`` says whether the training of a method with its parameters takes no capture.
    """

    camera: bool = False
    privileged: bool = False
    trains: bool = False
    follows: bool = False
    planes: bool = False
    views: bool = False
    fresnel: bool = False
    form: frozenset[str] | None = None
    title: str | None = None
    tuned: str | None = None
    version: int = 1
    timed: bool = True
    simulates: bool = False
    functions: frozenset[Function] = frozenset()

    @property
    def sees(self) -> bool:
        """Whether what it finds for a target depends on the display and not on its nominal optics alone."""
        return self.camera or self.privileged


FLAGS = tuple(item.name for item in fields(Traits) if item.name not in ("timed", "simulates", "functions"))
"""What any method may declare; only one that ships may say that it is not timed, or simulates a bench."""
BOOLEANS = tuple(item.name for item in fields(Traits) if isinstance(item.default, bool) and item.name in FLAGS)

SCENES = {"planes": "solve_planes", "views": "solve_views"}
"""Flags that promise a function."""

LINE = "text in one line"
WANTED = {"form": "a set of text", "title": LINE, "tuned": LINE, "version": "a whole number from 0 up"}


def _is_flag(flag: str, value: object) -> bool:
    if flag == "version":
        return type(value) is int and value >= 0
    if flag in ("title", "tuned"):
        return value is None or (isinstance(value, str) and value.isprintable())
    if flag == "form":
        return value is None or (isinstance(value, Collection) and all(isinstance(each, str) for each in value))
    return isinstance(value, bool)


def traits_of(method: object, name: str = "") -> Traits:
    """The traits of a method, given as its class or as an object of it.

    name: its name in messages, by default that of its class. UserError where a flag is not what it has to be.
    """
    cls = method if isinstance(method, type) else type(method)
    owner = f"method '{name or cls.__name__}'"
    declared: dict[str, Any] = {item.name: getattr(method, item.name, item.default) for item in fields(Traits)}
    for flag, value in declared.items():
        if flag in FLAGS and not _is_flag(flag, value):
            raise UserError(f"{owner}: {flag} should be {WANTED.get(flag, 'True or False')}")
    has = frozenset(function for function in FUNCTIONS if callable(getattr(method, function, None)))
    for flag, function in SCENES.items():
        if declared[flag] and function not in has:
            raise UserError(f"{owner}: {flag} is True, which needs a function {function}")
    return Traits(**declared | {"functions": has})


def refuse_plane(traits: Traits, name: str, spec: DisplaySpec) -> None:
    """UserError for a method of that name that needs a Fresnel plane, on a display with its image in another."""
    if traits.fresnel and spec.plane != "fresnel":
        raise UserError(
            f"method '{name}' needs the image in a Fresnel plane; '{spec.name}' has it in the Fourier plane of a lens, "
            "for which gerchberg_saxton, wirtinger and sgd are"
        )
