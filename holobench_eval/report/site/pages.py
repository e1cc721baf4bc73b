"""What the pages show: the boards of every study, a card a display, the places of a method."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property, lru_cache
from inspect import getdoc
from typing import Any

from ...core import plugins
from ...core.errors import UserError
from ...display.simulated.profile import load_profile, names
from ...display.simulated.shelf import installed
from ..answers.comparison import of_display
from ..data import board as boards
from ..data.phrases import verdict
from ..data.statistics import Estimate
from ..data.text import grouped, number
from .html import slug
from .intake import Source, text_of
from .pictures import STAGES, Picture, figures, thumbnails

BOARD = "board"  # the key of a provenance that says whether a study enters the pages of displays
FACTS = ("by", "package", "harness", "revision", "dirty", "command", "config_sha256", "python", "platform", "cpu",
         "gpu", "device", "threads", "workers", "started", "ended")  # fmt: skip

Shown = dict[str, Any]  # the board of a display in a study


@dataclass(frozen=True)
class Study:
    """A source with its pictures. slug: of its page; sheets: of the stages of its displays; left: figures left out."""

    source: Source
    slug: str
    thumbnails: list[Picture]
    figures: list[Picture]
    sheets: list[Picture]
    left: int

    @property
    def enters(self) -> bool:
        """Whether it enters the pages of displays."""
        return self.source.known.get(BOARD) is True

    @property
    def whose(self) -> str:
        """Words behind its name."""
        return f", by {self.source.by}" if self.source.by else ""

    @property
    def question(self) -> str:
        """What report.md of an own study asks; of others what they have named."""
        try:
            return "" if self.source.by else str(json.loads(text_of(self.source.folder / "board.json"))["question"])
        except (ValueError, KeyError, TypeError, RecursionError):
            return ""

    @property
    def facts(self) -> list[tuple[str, str]]:
        """What the provenance says of it."""
        known = self.source.known
        return [(name, str(known[name])) for name in FACTS if known.get(name) not in (None, "")]

    @property
    def notes(self) -> str:
        """What its page leaves out."""
        changed = self.source.changed
        notes = [f"{self.left} more figures are in its folder."] if self.left else []
        return " ".join([*notes, *([f"{changed} conditions are changes of a display, and not shown."] * bool(changed))])

    @cached_property
    def boards(self) -> list[Shown]:
        """Of its displays."""
        whole = boards.board(self.source.results)
        return [_shown(self, whole, display) for display in whole.displays]


def studies(sources: Sequence[Source]) -> list[Study]:
    """The studies with their pictures; folders of one name are numbered."""
    found: dict[str, Study] = {}
    for source in sources:
        name, count = slug(source.name), 1
        while name in found:
            count += 1
            name = f"{slug(source.name)}-{count}"
        found[name] = Study(source, name, thumbnails(source, name), *figures(source, name))
    return list(found.values())


def _shown(study: Study, whole: boards.Board, display: boards.Display) -> Shown:
    """The board of a display in a study, as templates take it."""
    source, results, score = study.source, study.source.results, study.source.results.headline
    count, clusters = len(results.targets), len(set(results.clusters))
    panels = results.frame.loc[results.frame["display"] == display.name, ["panel_height_px", "panel_width_px"]].dropna()
    sides = [f", panel of {height:.0f} x {width:.0f} pixels" for height, width in panels.head(1).to_numpy()]
    title, about = _identity(source, display.name)
    drawn = [estimate for row in display.rows if (estimate := _drawn(row))]
    ends = [0.0, *(end for estimate in drawn for end in (estimate.low, estimate.high))]
    answers = [picture for picture in study.figures if picture.of == "answer-pictures"]
    return {
        "title": title,
        "about": about,
        "heading": "".join([score.heading, *sides]),
        "score": score,
        "baseline": results.layout.baseline,
        "beside": whole.beside,
        "floor": "" if display.floor is None else f" A gray picture scores {score.with_unit(display.floor)}.",
        "counted": f"{count} targets{f' in {clusters} clusters' if clusters < count else ''}.",
        "verdict": of_display(results, display) if results.layout.measure == "picture" else "",
        "left": min(ends),  # of the drawings
        "width": max(ends) - min(ends) or 1.0,
        "groups": [
            {"name": boards.GROUPS[group], "rows": [_row(whole, row) for row in rows]} for group, rows in display.groups
        ],
        "pictures": answers if display.name == results.conditions[0] else [],
        "sheets": [picture for picture in study.sheets if picture.of == f"{STAGES}{display.name}"],
        "of": study,
    }


def _identity(source: Source, name: str) -> tuple[str, str]:
    """Title and description of a display, and of a twin how far it can be trusted.

    They are those of this package, or of another, that has the display by this digest.

    Another display or version has the beginning of its digest beside its name, or its lab.
    """
    kind = source.known.get("displays", {}).get(name, "simulated")
    digest = source.known.get("profiles", {}).get(name, {}).get("sha256", "")
    known = [name] if name in {*names(), *names(family=True)} else []
    for shown in [*known, *installed()] if kind == "simulated" else ():
        with suppress(UserError):  # of others' files
            if (profile := load_profile(shown)).digest == digest:
                trust = profile.twin.words
                return shown, f"{profile.description}{f' It is {trust}.' if trust else ''}"
    other = ", ".join(filter(None, (kind if kind != "simulated" else "", digest[:8] or source.by or source.name)))
    return f"{name} ({other})", "Another display, or another version of one, than is installed here."


def _drawn(row: boards.Row) -> Estimate | None:
    """The difference of a row that is drawn."""
    return row.test.estimate if row.test and math.isfinite(row.test.estimate.low) else None


def _row(whole: boards.Board, row: boards.Row) -> dict[str, Any]:
    results, score, test = whole.results, whole.results.headline, row.test
    found = verdict(score, test) if test else ""
    return {
        "tier": row.tier,
        "method": results.names[row.label],
        "name": ", ".join([row.label, *whole.marks(row)]),
        "score": score.number(row.score.mean),
        "difference": score.estimate(test.estimate, signed=True) if test else "",
        "verdict": found if found in ("better", "worse") else "same",
        "drawn": _drawn(row),
        "beside": [each.number(value) for each, value in zip(whole.beside, row.beside, strict=True)],
        "photographs": number(row.photographs),
        "seconds": number(row.seconds),
    }


def places(found: Sequence[Study], method: str) -> list[dict[str, Any]]:
    """The rows of a method on every display of every study."""
    return [
        {**row, "display": shown["title"], "baseline": shown["baseline"], "of": study, "unit": shown["score"].unit}
        for study in found
        for shown in study.boards
        for group in shown["groups"]
        for row in group["rows"]
        if row["method"] == method
    ]


@lru_cache(maxsize=256)
def about(method: str) -> str:
    """What a method of the package is. Others' files are not opened."""
    if method not in plugins.names("methods"):
        return "A method that does not come with this package; its folder of results tells nothing of its code."
    return " ".join((getdoc(plugins.find("methods", method)) or "").partition("\n\n")[0].replace("`", "").split())


def cards(found: Sequence[Study]) -> dict[str, list[Shown]]:
    """The boards that enter, by the title of their display, own ones first."""
    entering = sorted((study for study in found if study.enters), key=lambda study: bool(study.source.by))
    return grouped((str(each["title"]), each) for study in entering for each in study.boards)
