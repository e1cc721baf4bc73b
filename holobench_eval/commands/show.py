"""``holoeval show``: what a display does to a hologram."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape
from rich.table import Table

from ..core.panels import is_small
from .options import PANEL, Profile
from .output import console


def show(
    profile: Profile,
    panel: Annotated[tuple[int, int] | None, PANEL] = None,
    output: Annotated[Path | None, typer.Option(help="Picture to write.")] = None,
) -> None:
    """Draw what a display does to a hologram: stage by stage, with a list of its effects."""
    import torch

    from ..report.charts.sheet import draw_sheet

    if panel is None or is_small(panel):
        torch.set_num_threads(1)  # see is_small
    path = draw_sheet(profile, panel, output)
    table = Table("effect", "", "parametric model", title=f"effects of {profile}", title_justify="left")
    for name, text, modelled in effects(profile):
        table.add_row(name, escape(text), "has it" if modelled else "lacks it")
    console().print(table)
    print(path)


def effects(source: str) -> Iterator[tuple[str, str, bool]]:
    """Name and description of every effect of a display profile, and whether the parametric model has a term for it."""
    from ..display import load_profile
    from ..methods.calibrated.display_model import FORM

    for effect in load_profile(source).effects():
        yield effect.name, effect.text, effect.name in FORM
