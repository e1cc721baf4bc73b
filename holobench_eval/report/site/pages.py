"""What the pages show: the boards of every study, a card a display, the places of a method."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property, lru_cache
from inspect import getdoc
from typing import Any

from ...core import plugins
from ...core.errors import UserError
from ...display.simulated.profile import load_profile, names
from ...display.simulated.shelf import installed
from ..board import Board, Display, Row, board
from ..results import Results
from ..stories.comparison import of_display
from ..text import grouped
from .pictures import STAGES, Picture

BOARD = "board"  # the key of a provenance that says whether a study enters the pages of displays
FACTS = ("package", "harness", "revision", "dirty", "command", "config_sha256", "python", "platform", "cpu", "gpu",
         "device", "threads", "workers", "started", "ended")  # fmt: skip


@dataclass(frozen=True)
class Study:
    """A report.

    name: of its study; results: its numbers without changed displays; known: its provenance; question: of the study;
    changed: how many conditions are a change of a display; slug: of its page; sheets: of the stages of its displays;
    left: how many figures are left out.
    """

    name: str
    results: Results
    known: Mapping[str, Any]
    question: str
    changed: int
    slug: str
    figures: list[Picture]
    sheets: list[Picture]
    left: int

    @property
    def enters(self) -> bool:
        """Whether it enters the pages of displays."""
        return self.known.get(BOARD) is True

    @property
    def processor(self) -> str:
        """What the seconds were taken on."""
        return str(self.known.get("gpu") or self.known.get("cpu") or "processor not recorded")

    @property
    def facts(self) -> list[tuple[str, str]]:
        """What the provenance says of it."""
        return [(name, str(self.known[name])) for name in FACTS if self.known.get(name) not in (None, "")]

    @property
    def notes(self) -> str:
        """What its page leaves out."""
        left = [f"{self.left} more figures are in its folder."] * bool(self.left)
        changed = [f"{self.changed} conditions are changes of a display, and not shown."] * bool(self.changed)
        return " ".join(left + changed)

    @cached_property
    def board(self) -> Board:
        """Of its displays."""
        return board(self.results)

    @cached_property
    def boards(self) -> list[Shown]:
        """A display each."""
        return [Shown(self, display, *_identity(self, display.name)) for display in self.board.displays]


@dataclass(frozen=True)
class Shown:
    """A display in a study, as templates take it; title, about: see ``_identity``."""

    of: Study
    display: Display
    title: str
    about: str

    @property
    def panel(self) -> str:
        """Its size, where that is known."""
        frame = self.of.results.frame
        sides = frame.loc[frame["display"] == self.display.name, ["panel_height_px", "panel_width_px"]].dropna()
        return "".join(f", panel of {height:.0f} x {width:.0f} pixels" for height, width in sides.head(1).to_numpy())

    @property
    def ends(self) -> list[float]:
        """Of the drawings of differences, zero among them."""
        drawn = [row.test.estimate for row in self.display.rows if row.test and row.test.estimate.has_interval]
        return [0.0, *(end for estimate in drawn for end in (estimate.low, estimate.high))]

    @property
    def verdict(self) -> str:
        """Of a comparison of pictures."""
        results = self.of.results
        return of_display(results, self.display) if results.study.measure == "picture" else ""

    @property
    def pictures(self) -> list[Picture]:
        """Those that answer, beside the first display."""
        is_first = self.display is self.of.board.displays[0]
        return [picture for picture in self.of.figures if is_first and picture.of == "answer-pictures"]

    @property
    def sheets(self) -> list[Picture]:
        """Of the stages of the display."""
        return [picture for picture in self.of.sheets if picture.of == f"{STAGES}{self.display.name}"]


def _identity(study: Study, name: str) -> tuple[str, str]:
    """Title and description of a display, and of a twin how far it can be trusted.

    They are those of this package, or of another, that has the display by this digest.

    Another display or version has the beginning of its digest beside its name, or its study.
    """
    kind = study.known.get("displays", {}).get(name, "simulated")
    digest = study.known.get("profiles", {}).get(name, {}).get("sha256", "")
    known = [name] if name in {*names(), *names(family=True)} else []
    for shown in [*known, *installed()] if kind == "simulated" else ():
        with suppress(UserError):  # of others' files
            if (profile := load_profile(shown)).digest == digest:
                trust = profile.twin.words
                return shown, f"{profile.description}{f' It is {trust}.' if trust else ''}"
    other = ", ".join(filter(None, (kind if kind != "simulated" else "", digest[:8] or study.name)))
    return f"{name} ({other})", "Another display, or another version of one, than is installed here."


def places(found: Sequence[Study], method: str) -> list[tuple[Shown, Row]]:
    """The rows of a method on every display of every study."""
    return [
        (shown, row)
        for study in found
        for shown in study.boards
        for row in shown.display.rows
        if study.results.names[row.label] == method
    ]


@lru_cache(maxsize=256)
def about(method: str) -> str:
    """What a method of the package is. Files of users are not opened."""
    if method not in plugins.names("methods"):
        return "A method that does not come with this package; its folder of results tells nothing of its code."
    return " ".join((getdoc(plugins.find("methods", method)) or "").partition("\n\n")[0].replace("`", "").split())


def cards(found: Sequence[Study]) -> dict[str, list[Shown]]:
    """The boards that enter, by the title of their display."""
    return grouped((each.title, each) for study in found if study.enters for each in study.boards)
