"""Displays of installed packages: folders of profiles, each named by an entry point.

A package says ``lab-x = "lab_x.benches"`` in its group ``holobench_eval.displays``: the files ``*.yaml`` of the folder
``benches`` in it are then the displays ``lab-x/NAME``. No code of the package is run.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from importlib.metadata import EntryPoint, entry_points
from importlib.util import find_spec
from pathlib import Path

from ...core.errors import UserError, suggest

GROUP = "holobench_eval.displays"


@dataclass(frozen=True)
class Shelf:
    """The displays of a package. package: its name and version; folder: of the profiles, None where there is none."""

    package: str
    folder: Path | None

    @property
    def files(self) -> dict[str, Path]:
        """The files of the displays by their names."""
        return {} if self.folder is None else {path.stem: path for path in sorted(self.folder.glob("*.yaml"))}

    def file(self, name: str) -> Path:
        """The file of a display. UserError: there is none of the name."""
        if name not in self.files:
            raise UserError(f"the package {self.package} has no display '{name}'; {suggest(name, self.files)}")
        return self.files[name]


@lru_cache
def shelves() -> dict[str, Shelf]:
    """The displays of every installed package, by the name of its entry point. UserError: two have the same name."""
    found: dict[str, Shelf] = {}
    for entry in sorted(entry_points(group=GROUP)):
        shelf = Shelf(f"{entry.dist.name} {entry.dist.version}" if entry.dist else entry.value, _folder(entry))
        if (other := found.setdefault(entry.name, shelf)) != shelf:
            both = f"{other.package} ({other.folder}) and {shelf.package} ({shelf.folder})"
            raise UserError(f"the displays of {both} are both named '{entry.name}/...'; uninstall one of them")
    return found


def _folder(entry: EntryPoint) -> Path | None:
    top, *below = entry.module.split(".")
    spec = find_spec(top)  # imports nothing
    places = (Path(place, *below) for place in (spec and spec.submodule_search_locations) or ())
    return next((place for place in places if place.is_dir()), None)


def installed() -> list[str]:
    """The displays of installed packages by the names that a config gives them, such as ``lab-x/bench-1``."""
    return sorted(f"{package}/{name}" for package, shelf in shelves().items() for name in shelf.files)
