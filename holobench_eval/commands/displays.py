"""``holoeval displays``: the shelf of displays, shipped, installed and given."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..core.errors import UserError
from ..core.stand_ins import only_words
from .output import console

if TYPE_CHECKING:
    from ..display import Profile

HEADINGS = ("display", "panel", "maps", "from", "what it is like")


def displays(
    folder: Annotated[list[Path] | None, typer.Option(metavar="DIR", help="Profiles in a folder, too.")] = None,
) -> None:
    """List the displays that a config may name: those that ship, of installed packages, and of given folders."""
    if not folder:  # whose profiles may have maps
        only_words()
    rows = [HEADINGS, *lines(sources(folder or ()))]
    *widths, _ = (max(map(len, column)) for column in zip(*rows, strict=True))
    screen = console()
    for *cells, last in rows:
        padded = [cell.ljust(width) for cell, width in zip(cells, widths, strict=True)]
        screen.print("  ".join([*padded, last]), markup=False, soft_wrap=True)


def sources(folders: Iterable[Path]) -> Iterator[tuple[str, str]]:
    """Every display by the name that a config gives it, and where it comes from."""
    from ..display.simulated.profile import names
    from ..display.simulated.shelf import installed, shelves

    yield from ((name, "this package") for name in (*names(), *names(family=True)))
    yield from ((name, shelves()[name.partition("/")[0]].package) for name in installed())
    for folder in folders:
        files = sorted(folder.glob("*.yaml"))
        if not files:
            raise UserError(f"no profile (*.yaml) in the folder {folder}")
        yield from ((str(file), "a file") for file in files)


def lines(listed: Iterable[tuple[str, str]]) -> Iterator[tuple[str, ...]]:
    """A row for each display; of a file with a fault, the fault, and of one with the name of another, both."""
    from ..display import load_profile

    seen = dict[str, str]()
    for name, whence in listed:
        try:
            profile = load_profile(name)
        except UserError as error:
            yield name, "", "", whence, str(error)
            continue
        other = seen.setdefault(profile.name, name)
        alike = f" ('{other}' is named '{profile.name}' too: no study has both)" if other != name else ""
        maps = profile.network.method or ("yes" if profile.held else "no")
        yield name, panel(profile), maps, whence, profile.description + alike


def panel(profile: Profile) -> str:
    """Pixels, pitch, bits and colours."""
    own = profile.panel
    colours = "gray" if len(own.wavelengths) == 1 else f"{len(own.wavelengths)} colours"
    return f"{own.shape[0]} x {own.shape[1]} of {own.pitch * 1e6:.3g} um, {own.bits} bit, {colours}"
