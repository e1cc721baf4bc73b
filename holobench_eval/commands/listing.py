"""What there is to choose from, as lines for ``holoeval list``."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from ..core import plugins
from ..core.errors import UserError


def _summary(thing: Any) -> str:
    return str(thing.__doc__ or "").strip().partition("\n")[0]


def _plugins(kind: plugins.Kind, marks: dict[str, str]) -> Iterator[tuple[str, str]]:
    """Name and description of every plug-in; one that cannot be imported says so and does not hide the others."""
    for name in plugins.names(kind):
        try:
            cls = plugins.find(kind, name)
        except UserError as error:
            yield name, str(error)
            continue
        marked = [word for flag, word in marks.items() if getattr(cls, flag, False)]
        yield name, _summary(cls) + (f" ({', '.join(marked)})" if marked else "")


def methods() -> Iterator[tuple[str, str]]:
    """Name and description of every registered method."""
    return _plugins("methods", {"camera": "captures", "privileged": "privileged"})


def datasets() -> Iterator[tuple[str, str]]:
    """Name and description of every registered dataset."""
    return _plugins("datasets", {"training": "for training, never scored"})


def profiles() -> Iterator[tuple[str, str]]:
    """Name and description of every display profile of the package."""
    from ..display import load_profile
    from ..display.simulated.profile import names

    for name in names():
        profile = load_profile(name)
        yield name, f"version {profile.version}: {profile.description}"


def effects(source: str) -> Iterator[tuple[str, str, bool]]:
    """Name and description of every effect of a display profile, and whether the parametric model has a term for it."""
    from ..display import load_profile
    from ..methods.display_model import FORM

    for effect in load_profile(source).effects():
        yield effect.name, effect.text, effect.name in FORM


def metrics() -> Iterator[tuple[str, str]]:
    """Name of every metric, the domains of its columns, and why it cannot be computed here if it cannot."""
    from ..metrics import catalogue

    for metric in catalogue():
        text = f"{', '.join(metric.domains)}; {metric.direction} is better; version {metric.version}"
        reason = metric.available()
        yield metric.name, text if reason is None else f"{text}; not available: {reason}"


KINDS: dict[str, Callable[[], Iterator[tuple[str, str]]]] = {
    "methods": methods,
    "datasets": datasets,
    "profiles": profiles,
    "metrics": metrics,
}
