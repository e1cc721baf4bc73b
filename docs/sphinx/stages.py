"""The directive ``{stage} KEY``: a stage of the simulated bench as the code describes it, and its picture.

Everything is derived: the model and the parameters from the stage's class, values and their sources from the profiles,
the picture from the bench (``stage_pictures``).
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import Field, fields
from importlib.resources import files
from inspect import getdoc
from pathlib import Path
from typing import Annotated, Any, get_args, get_origin, get_type_hints

import torch
from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective
from stage_pictures import SHOWN, draw, shipped

import holobench_eval.display.simulated
from holobench_eval.display.simulated.profile import STAGES

PROFILES = ("leto-2020", "leto-aged")
FOLDER = "build/stages"


class StageDirective(SphinxDirective):
    """``{stage} KEY``."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """The stage as nodes, parsed from Markdown."""
        key = self.arguments[0]
        if key not in STAGES:
            raise self.error(f"there is no stage '{key}'; there are {', '.join(STAGES)}")
        return self.parse_text_to_nodes("\n".join(markdown(key)))


def markdown(key: str) -> Iterator[str]:
    """The lines of a stage."""
    stage = STAGES[key]
    yield from ("", f"**Model:** {stage.model}.", "")
    yield from (f"```{{figure}} /{FOLDER}/{key}.png", f":alt: {stage.title}, without and with")
    yield from (f"One hologram on `ideal`, without the stage and with it: {SHOWN[key].words}.", "```", "")
    keys = [each for each in fields(stage) if each.metadata.get("key", True)]
    yield from (as_code(getdoc(stage) or "", [each.name for each in keys]), "")
    if keys:
        yield from table(stage, key, keys)
    for profile in PROFILES:
        block = source(profile, key)
        if block:
            yield from ("", f"As [`{profile}.yaml`]({path(profile)}) has it, with its sources:", "")
            yield from ("```yaml", block, "```", "")
            return


def as_code(text: str, names: list[str]) -> str:
    """A docstring with the names of parameters as code where it introduces them, as in ``name:`` or ``name [m]``."""
    introduced = rf"(?<![`\w])({'|'.join(names or ['$'])})(?=:| \[| \(|, (?:{'|'.join(names or ['$'])})\b|; )"
    return re.sub(introduced, r"`\1`", text)


def table(stage: type[Any], key: str, keys: list[Field[Any]]) -> Iterator[str]:
    """Every parameter: default, what is allowed, and the values of two profiles."""
    hints = get_type_hints(stage, include_extras=True)
    values = [getattr(shipped(profile), key) for profile in PROFILES]
    yield f"| parameter | default | allowed | {' | '.join(f'`{name}`' for name in PROFILES)} |"
    yield f"|---|---|---|{'---|' * len(PROFILES)}"
    for each in keys:
        default = each.default_factory() if callable(each.default_factory) else each.default  # type: ignore[misc]
        texts = [text(default) if isinstance(default, (*PLAIN, type(None))) else "required", allowed(hints[each.name])]
        texts += ["–" if value is None else text(getattr(value, each.name)) for value in values]
        yield f"| `{each.name}` | {' | '.join(texts)} |"


PLAIN = (bool, int, float, str, tuple, dict)


def text(value: Any) -> str:
    """A value as YAML has it."""
    if isinstance(value, dict):
        return ", ".join(f"{name} {number:g}" for name, number in value.items()) or "{}"
    if isinstance(value, tuple):
        return "[" + ", ".join(text(item) for item in value) + "]" if value else "[]"
    if value is None or isinstance(value, bool):
        return {None: "null", True: "true", False: "false"}[value]
    return f"{value:g}" if isinstance(value, float) else str(value)


def allowed(hint: Any) -> str:
    """The interval of a number, from its annotation; empty where any value will do."""
    for option in (hint, *get_args(hint)):
        if get_origin(option) is Annotated:
            limits = option.__metadata__[0]
            low = getattr(limits, "ge", None), getattr(limits, "gt", None)
            high = getattr(limits, "le", None), getattr(limits, "lt", None)
            return ", ".join(_bound(*low, "≥", ">") + _bound(*high, "≤", "<"))
    return ""


def _bound(inclusive: float | None, exclusive: float | None, sign: str, strict: str) -> list[str]:
    if inclusive is not None:
        return [f"{sign} {inclusive:g}"]
    return [] if exclusive is None else [f"{strict} {exclusive:g}"]


def path(profile: str) -> str:
    """Of a profile's file, from the root of the repository."""
    return f"/holobench_eval/display/simulated/profiles/{profile}.yaml"


def source(profile: str, key: str) -> str:
    """The lines of a profile's file that give a stage its values, with their comments; empty where it gives none."""
    file = files(holobench_eval.display.simulated) / "profiles" / f"{profile}.yaml"
    found = re.search(rf"^{key}:.*\n(?:[ #].*\n)*", file.read_text(encoding="utf-8"), re.MULTILINE)
    return found.group(0).rstrip() if found else ""


def draw_all(app: Sphinx) -> None:
    """Draw every stage before a page is read."""
    torch.set_num_threads(1)
    for key in SHOWN:
        draw(key, Path(app.srcdir, FOLDER, f"{key}.png"))


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the directive."""
    app.add_directive("stage", StageDirective)
    app.connect("builder-inited", draw_all)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
