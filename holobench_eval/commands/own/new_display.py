"""``holoeval new-display``: the file of a display, with every key explained, to be changed."""

from __future__ import annotations

import json
import re
import textwrap
from pathlib import Path
from typing import Annotated

import typer

from ...core.errors import UserError
from .new_method import write_new

STARTS_AS = "ideal"  # whose panel the file has until it is changed
FIRST = "sampling"  # of the keys that a display may leave out
HEAD = """\
# A display of your own. It starts with the panel of '{base}': put in the values of your data sheet, lengths in metres,
# and take the '#' off what else your display has. docs/displays.md has the same keys as tables.
#     holoeval list {file}       what it says
#     holoeval show {file}       what it does to a hologram, stage by stage
# In a study: display: {{profiles: [{file}], panel: [256, 256]}}
"""


def new_display(
    name: Annotated[str, typer.Argument(help="What the display is called, such as my-display.")],
    folder: Annotated[Path, typer.Option(help="Where to write NAME.yaml.")] = Path(),
) -> None:
    """Write the file of a display, every key explained."""
    from ...display.simulated.profile import names

    if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9_-]*", name):
        raise UserError(f"'{name}' is no name for a display; use letters, digits, - and _, such as 'my-display'")
    if name in names():
        raise UserError(f"'{name}' is the name of a display that ships; choose another")
    (path,) = write_new(folder, {f"{name}.yaml": display_text(name)})
    print(f"{path}\nnext: change it; holoeval list {path}, holoeval show {path}")


def display_text(name: str) -> str:
    """The text of a new display's file: what it needs as values, all else as comments with their defaults."""
    from ...core.parameters import parameters
    from ...display import load_profile
    from ...display.simulated.profile import STAGES, Profile

    panel = vars(load_profile(STARTS_AS).panel)
    own = {"name": name, "version": 1, "seed": 0, "description": "A display of my own."}
    own |= {f"panel.{key}": value for key, value in panel.items()}
    lines = [HEAD.format(base=STARTS_AS, file=f"{name}.yaml")]
    for parameter in parameters(Profile):
        *owners, key = parameter.name.split(".")
        is_own = parameter.name in own or parameter.name == "panel"
        value = "" if parameter.default == "" or parameter.allowed.endswith("mapping of:") else f" {parameter.default}"
        value = f" {json.dumps(own[parameter.name])}" if parameter.name in own else value
        words = parameter.meaning or STAGES[key].model
        words += "" if parameter.allowed.endswith("mapping of:") else f" ({parameter.allowed})"
        block = [*(f"# {line}" for line in textwrap.wrap(words, 100)), f"{key}:{value}"]
        lines += ["", "# what is not ideal: take the '#' off"] * (parameter.name == FIRST)
        lines += [f"{'' if is_own else '# '}{'  ' * len(owners)}{line}" for line in block]
    return "\n".join(lines) + "\n"
