"""``holoeval list``: what there is to choose from."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import TYPE_CHECKING, Annotated

import typer
from rich.markup import escape
from rich.table import Table

from ..core.errors import UserError, suggest
from .output import console

if TYPE_CHECKING:
    from ..core import plugins

Entries = Iterator[tuple[str, str]]  # names and descriptions


def list_(
    kind: Annotated[str | None, typer.Argument(help="methods, datasets, profiles or metrics; all without.")] = None,
) -> None:
    """List what a config may name."""
    if kind is not None and kind not in KINDS:
        raise UserError(f"unknown kind '{kind}'; {suggest(kind, KINDS)}")
    screen = console()
    for name in [kind] if kind else KINDS:
        table = Table(title=name, title_justify="left", show_header=False)
        for entry, text in KINDS[name]():
            table.add_row(entry, escape(text))
        screen.print(table)


def plug_ins(kind: plugins.Kind, **marks: str) -> Entries:
    """Every registered plug-in; one that cannot be imported gives the reason and does not hide the others.

    marks: what is noted of a class that has the flag of that name.
    """
    from ..core import plugins

    for name in plugins.names(kind):
        try:
            cls = plugins.find(kind, name)
        except UserError as error:
            yield name, str(error)
            continue
        summary = str(cls.__doc__ or "").strip().partition("\n")[0]
        marked = [word for flag, word in marks.items() if getattr(cls, flag, False)]
        yield name, summary + (f" ({', '.join(marked)})" if marked else "")


def profiles() -> Entries:
    """Every display profile of the package."""
    from ..display import load_profile
    from ..display.simulated.profile import names

    for name in names():
        profile = load_profile(name)
        yield name, f"version {profile.version}: {profile.description}"


def metrics() -> Entries:
    """Every metric, with the domains of its columns and the reason where it cannot be computed here."""
    from ..metrics import catalogue

    for metric in catalogue():
        text = f"{', '.join(metric.domains)}; {metric.direction} is better; version {metric.version}"
        reason = metric.available()
        yield metric.name, text if reason is None else f"{text}; not available: {reason}"


KINDS: dict[str, Callable[[], Entries]] = {
    "methods": partial(plug_ins, "methods", camera="captures", privileged="privileged"),
    "datasets": partial(plug_ins, "datasets", training="for training, never scored"),
    "profiles": profiles,
    "metrics": metrics,
}
