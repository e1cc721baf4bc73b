"""``holoeval list``: what there is to choose from."""

from __future__ import annotations

import difflib
import inspect
import sys
from collections.abc import Callable, Iterator
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console
from rich.markup import escape
from rich.padding import Padding
from rich.table import Table

from ..core.errors import UserError, suggest
from ..core.installed import shipped_configs
from ..core.stand_ins import only_words
from .displays import sources
from .output import console

if TYPE_CHECKING:
    from ..core import plugins
    from ..display.simulated.changes.kind import Kind as Change
    from ..metrics.base import Metric

Entries = Iterator[tuple[str, str]]  # names and descriptions


def list_(
    name: Annotated[
        str | None,
        typer.Argument(
            help="studies, methods, datasets, profiles, metrics, conditions; or one by its name, such as wirtinger, "
            "mine.py:solve or mine.yaml."
        ),
    ] = None,
) -> None:
    """List what a config may name; of one method, dataset or other name, its parameters and its paper."""
    screen = console()
    if name is None or name in KINDS:
        only_words()
        for kind in [name] if name else KINDS:
            table = Table(title=kind, title_justify="left", show_header=False)
            for entry, text in KINDS[kind][0]():
                table.add_row(entry, escape(text))
            screen.print(table)
        return
    of_a_file = "methods" if ".py:" in name else "profiles" if name.endswith((".yaml", ".yml")) else ""
    found = [of_a_file] if of_a_file else [kind for kind in KINDS if name in dict(KINDS[kind][0]())]
    if not found:
        raise UserError(_unknown(name))
    for kind in found:
        KINDS[kind][1](screen, name)


def _unknown(name: str) -> str:
    """What to say of a name that is none."""
    names = {entry for kind in KINDS for entry, _ in KINDS[kind][0]()}
    near = difflib.get_close_matches(name, [*KINDS, *names], n=1)
    if (within := sorted(entry for entry in names if name in entry)) and not (near and near[0] in KINDS):
        return f"unknown name '{name}'; names with it: {', '.join(within)}"
    if not near or near[0] in KINDS:
        return f"unknown kind '{name}'; {suggest(name, KINDS)}, or a name that holoeval list shows"
    return f"unknown name '{name}'; did you mean '{near[0]}'? holoeval list shows them all"


def studies() -> Entries:
    """Every study that ships and every part of one, with its title."""
    for name in shipped_configs():
        keys = _keys(name)
        yield name, keys["title"]
        yield from ((f"{name}/{part}", own.get("title", keys["title"])) for part, own in keys.get("parts", {}).items())


@cache
def _keys(name: str) -> dict[str, Any]:
    """The keys of a config that ships, or of a part of one."""
    import yaml

    file, _, part = name.partition("/")
    keys = yaml.load(shipped_configs()[file].read_bytes(), getattr(yaml, "CSafeLoader", yaml.SafeLoader))
    return {**keys, **keys["parts"][part]} if part else keys


def plug_ins(kind: plugins.Kind, **marks: str) -> Entries:
    """Every registered plug-in; one that cannot be imported gives the reason and does not hide the others.

    marks: what is noted of a class that has the flag of that name.
    """
    from ..core import plugins
    from ..core.parameters import summary

    for name in plugins.names(kind):
        try:
            cls = _declared(kind, name)
        except UserError as error:
            yield name, str(error)
            continue
        marked = [word for flag, word in marks.items() if getattr(cls, flag, False) is True]
        yield name, summary(cls).partition("\n\n")[0] + (f" ({', '.join(marked)})" if marked else "")


def _declared(kind: plugins.Kind, name: str) -> type[Any]:
    """The class of a plug-in, or what stands for a method of another package, whose code is not imported here."""
    from ..core import plugins

    if kind != "methods" or plugins.is_shipped(kind, name):
        return plugins.find(kind, name)
    from ..study import isolation

    return isolation.find(name, Path())


def profiles() -> Entries:
    """Every display profile of the package and of installed ones; one with a fault gives that."""
    from ..display import load_profile

    for name, _ in sources(()):
        try:
            profile = load_profile(name)
        except UserError as error:
            yield name, str(error)
            continue
        yield name, f"version {profile.version}: {profile.description}"


def metrics() -> Entries:
    """Every metric, with its unit, the domains of its columns and the reason where it cannot be computed here."""
    from ..metrics import catalogue

    for metric in catalogue():
        yield metric.name, f"{_paragraphs(metric)[0].rstrip('.')}; {_facts(metric)}"


def _facts(metric: Metric) -> str:
    """What the columns of a metric are."""
    unit = f" [{metric.unit}]" if metric.unit else ""
    text = f"{', '.join(metric.domains)}{unit}; {metric.direction} is better; version {metric.version}"
    reason = metric.available()
    return text if reason is None else f"{text}; not available: {reason}"


def _paragraphs(metric: Metric) -> list[str]:
    """What a metric is and its source, by the text of its file."""
    function: Any = getattr(metric.function, "func", metric.function)  # one of a family is a partial function
    text = inspect.cleandoc(sys.modules[function.__module__].__doc__ or "").replace("`", "")
    return [" ".join(paragraph.split()) for paragraph in text.split("\n\n")]


def conditions() -> Entries:
    """Every change at test time that a sweep may name, with unit and range of its values."""
    from ..display.simulated.changes import KINDS as CHANGES

    for name, kind in CHANGES.items():
        yield name, f"{kind.words}; {_values_of(kind)}"


def _values_of(kind: Change) -> str:
    """What the values of a change at test time may be."""
    if kind.counted:
        return "values: whole numbers from 1, or a count"
    if not kind.numeric:
        return f"values: {kind.names}"
    unit = f" [{kind.unit}]" if kind.unit else ""
    return f"values{unit} from {kind.low:g} to {kind.high:g}; {kind.nominal:g} changes nothing"


def explain_study(screen: Console, name: str) -> None:
    """Print what a study asks, and where its config is."""
    keys, (file, _, part) = _keys(name), name.partition("/")
    _heading(screen, "studies", name, [])
    words: dict[str, str] = {key: keys[key] for key in ("title", "question", "would_change") if key in keys}
    if not part and "parts" in keys:
        words["parts"] = ", ".join(keys["parts"])
    words |= {"config": str(shipped_configs()[file] / part), "run": f"holoeval run {name}"}
    for key, text in words.items():
        said = key.replace("would_change", "would change the answer")
        screen.print(escape(f"{said}: {' '.join(text.split())}"), soft_wrap=key == "config")


def explain_plug_in(kind: plugins.Kind, screen: Console, name: str) -> None:
    """Print what a method or a dataset is, its paper and its parameters."""
    from ..core.parameters import words
    from ..study import isolation

    cls = _declared(kind, name)
    said = isolation.words(name, Path()) if kind == "methods" else words(cls)
    marks = [word for flag, word in MARKS.items() if getattr(cls, flag, False) is True]
    _heading(screen, kind, name, marks)
    screen.print(escape(said.summary))
    if said.source:
        screen.print(f"\nSource: {escape(said.source)}")
    if hasattr(cls, "tuned"):
        screen.print(f"\nTuned: {escape(cls.tuned)}")
    if not said.parameters:
        screen.print("\nIt has no parameters.")
        return
    screen.print("\nIts parameters (params: in a config), each with its default and what it may be:")
    for entry in said.parameters:
        default = f" = {entry.default}" if entry.default else ""
        screen.print(f"[bold]{entry.name}[/bold]{escape(default)}   ({escape(entry.allowed)})")
        screen.print(Padding(escape(entry.meaning), (0, 0, 0, 4), expand=False))


def explain_profile(screen: Console, name: str) -> None:
    """Print what a display profile is, its stages, and its effects."""
    from ..display import load_profile
    from ..display.resolution import refuse_far
    from ..report.description import simulated

    profile = load_profile(name)
    shown = simulated(profile, None)
    _heading(screen, "profiles", name, [])
    screen.print(escape("\n".join((shown.heading, shown.basis, *shown.lines))))
    table = Table(title="\neffects", title_justify="left", show_header=False)
    for effect in profile.effects():
        table.add_row(effect.name, escape(effect.text))
    screen.print(table)
    try:
        refuse_far(profile.spec(profile.usual), profile.panel.distance)
    except UserError as error:
        screen.print(escape(str(error)))
    else:
        if profile.network.method is None:
            screen.print(f"holoeval show {name} draws them.")


def explain_metric(screen: Console, name: str) -> None:
    """Print what a metric is, its source, and its columns."""
    from ..metrics import catalogue

    metric = next(metric for metric in catalogue() if metric.name == name)
    _heading(screen, "metrics", name, [])
    screen.print(escape("\n\n".join(_paragraphs(metric))))
    screen.print(f"\n{escape(_facts(metric))}\ncolumns: {', '.join(metric.columns)}")


def explain_condition(screen: Console, name: str) -> None:
    """Print what a change at test time is, its values and its model."""
    from ..display.simulated.changes import KINDS as CHANGES

    kind = CHANGES[name]
    _heading(screen, "conditions", name, [])
    lines = (f"{kind.words}; {_values_of(kind)}", f"Model: {kind.model}", f"Changes: {', '.join(kind.stages)}")
    screen.print(escape("\n".join(lines)))
    values = "count: 3" if kind.counted else "values: [...]"
    screen.print(f"In a config: sweeps: [{{condition: {name}, {values}}}]", markup=False)


def _heading(screen: Console, kind: str, name: str, marks: list[str]) -> None:
    marked = f" ({', '.join(marks)})" if marks else ""
    screen.print(f"[bold]{name}[/bold], one of the {kind}{marked}")


MARKS = {
    "camera": "captures",
    "trains": "is trained first",
    "privileged": "privileged",
    "training": "for training, never scored",
}
# By kind: its names with their descriptions, and what prints all of one.
KINDS: dict[str, tuple[Callable[[], Entries], Callable[[Console, str], None]]] = {
    "studies": (studies, explain_study),
    "methods": (
        partial(plug_ins, "methods", camera="captures", privileged="privileged"),
        partial(explain_plug_in, "methods"),
    ),
    "datasets": (
        partial(plug_ins, "datasets", training="for training, never scored"),
        partial(explain_plug_in, "datasets"),
    ),
    "profiles": (profiles, explain_profile),
    "metrics": (metrics, explain_metric),
    "conditions": (conditions, explain_condition),
}
