"""What the pages show: the boards of every study, a card a display, the places of a method."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from inspect import getdoc
from pathlib import Path
from typing import Any

from ...core import plugins
from ...display.simulated.profile import Profile, load_profile, names
from ..answers.comparison import of_display
from ..data import board as boards
from ..data.phrases import verdict
from ..data.statistics import Estimate
from ..data.text import number
from .html import slug
from .intake import Source
from .pictures import Picture

BOARD = "board"  # the key of a provenance that says whether a study enters the pages of displays
WIDTH, EDGE = 200, 6  # of a row's drawing
FACTS = ("by", "package", "harness", "revision", "dirty", "command", "config_sha256", "python", "platform", "cpu",
         "gpu", "device", "threads", "workers", "started", "ended")  # fmt: skip

Placed = tuple[str, Picture]  # path below the site
Shown = dict[str, Any]  # the board of a display in a study


@dataclass(frozen=True)
class Study:
    """A source with its pictures. slug: of its page; figures, thumbnails: with their paths; left: figures left out."""

    source: Source
    slug: str
    figures: Sequence[Placed]
    thumbnails: Sequence[Placed]
    left: int
    sheets: Mapping[str, Placed] = field(default_factory=dict)

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
        text = "" if self.source.by else _text(self.source.folder / "board.json")
        try:
            return str(json.loads(text)["question"]) if text else ""
        except (ValueError, KeyError, TypeError, RecursionError):
            return ""

    @cached_property
    def boards(self) -> list[Shown]:
        """Of its displays."""
        whole = boards.board(self.source.results)
        return [shown(self, whole, display) for display in whole.displays]


def shown(study: Study, whole: boards.Board, display: boards.Display) -> Shown:
    """The board of a display in a study, as templates take it."""
    source, results, score = study.source, study.source.results, study.source.results.headline
    profile, digest = _profile(source, display.name), _digest(source, display.name)
    panel = source.panels.get(display.name, "")
    count, clusters = len(results.targets), len(set(results.clusters))
    place, kind = _places(display), _kind(source, display.name)
    other = ", ".join(filter(None, (kind if kind != "simulated" else "", digest[:8] or source.by or source.name)))
    return {
        "name": display.name,
        # another display or version than that of the package has the beginning of its digest, or its lab
        "title": display.name if profile else f"{display.name} ({other})",
        "about": profile.description
        if profile
        else "Another display, or another version of one, than in this package.",
        "heading": f"{score.heading}{f', panel of {panel} pixels' if panel else ''}",
        "score": score,
        "baseline": results.layout.baseline,
        "beside": whole.beside,
        "floor": "" if display.floor is None else f" A gray picture scores {score.with_unit(display.floor)}.",
        "counted": f"{count} targets{f' in {clusters} clusters' if clusters < count else ''}.",
        "verdict": of_display(results, display) if source.measure == "picture" else "",
        "zero": place(0.0),
        "groups": [
            {"name": boards.GROUPS[group], "rows": [_row(study, whole, row, place) for row in rows]}
            for group, rows in display.groups
        ],
        "pictures": [
            placed
            for placed in study.figures
            if display.name == results.conditions[0] and placed[1].of == "answer-pictures"
        ],
        "sheet": study.sheets.get(display.name),
        "of": study,
    }


def _digest(source: Source, name: str) -> str:
    known = dict(source.known.get("profiles") or {}).get(name)
    return str(known.get("sha256", "")) if isinstance(known, Mapping) else ""


def _kind(source: Source, name: str) -> str:
    """Simulated, real or learned, as its folder says."""
    return str(dict(source.known.get("displays") or {}).get(name, "simulated"))


def _profile(source: Source, name: str) -> Profile | None:
    """That of the package, where a simulated display has its digest."""
    if _kind(source, name) != "simulated" or name not in {*names(), *names(family=True)}:
        return None
    profile = load_profile(name)
    return profile if profile.digest == _digest(source, name) else None


def _drawn(row: boards.Row) -> Estimate | None:
    """The difference of a row that is drawn."""
    return row.test.estimate if row.test and math.isfinite(row.test.estimate.low) else None


def _places(display: boards.Display) -> Callable[[float], float]:
    """Where a difference stands in the drawings of a display [px]."""
    found = [estimate for row in display.rows if (estimate := _drawn(row))]
    ends = [0.0, *(end for estimate in found for end in (estimate.low, estimate.high))]
    low, scale = min(ends), (WIDTH - 2 * EDGE) / (max(ends) - min(ends) or 1.0)
    return lambda value: round(EDGE + (value - low) * scale, 2)


def _row(study: Study, whole: boards.Board, row: boards.Row, place: Callable[[float], float]) -> dict[str, Any]:
    results, test, drawn = study.source.results, row.test, _drawn(row)
    score, total = results.headline, len(results.targets)
    lacks = [f"{row.scored} of {total} targets"] if row.scored < total else []
    found = verdict(score, test) if test else ""
    return {
        "tier": row.tier,
        "method": results.names[row.label],
        "name": ", ".join([row.label, *row.marks, *lacks]),
        "score": score.number(row.score.mean),
        "difference": score.estimate(test.estimate, signed=True) if test else "",
        "verdict": found if found in ("better", "worse") else "same",
        "mark": {end: place(getattr(drawn, end)) for end in ("low", "mean", "high")} if drawn else None,
        "beside": [each.number(value) for each, value in zip(whole.beside, row.beside, strict=True)],
        "photographs": number(math.nan if row.photographs is None else row.photographs),
        "seconds": number(math.nan if row.seconds is None else row.seconds),
    }


def places(studies: Sequence[Study], method: str) -> list[dict[str, Any]]:
    """The rows of a method on every display of every study."""
    return [
        {**row, "display": shown["title"], "baseline": shown["baseline"], "of": study, "unit": shown["score"].unit}
        for study in studies
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


def facts(source: Source) -> list[tuple[str, str]]:
    """What the provenance says of a study."""
    return [(name, str(source.known[name])) for name in FACTS if source.known.get(name) not in (None, "")]


def cards(studies: Sequence[Study]) -> dict[str, list[Shown]]:
    """The boards that enter, by the title of their display, own ones first."""
    found: dict[str, list[Shown]] = {}
    for study in sorted(studies, key=lambda study: bool(study.source.by)):
        for shown in study.boards if study.enters else ():
            found.setdefault(shown["title"], []).append(shown)
    return found


def _text(path: Path) -> str:
    readable = path.is_file() and not path.is_symlink() and path.stat().st_size < 10_000_000
    return path.read_text(encoding="utf-8", errors="replace") if readable else ""


def slugs(sources: Sequence[Source]) -> list[str]:
    """The name of each study's page; folders of one name are numbered."""
    found: list[str] = []
    for source in sources:
        name, count = slug(source.name), 1
        while name in found or name == "displays":
            count += 1
            name = f"{slug(source.name)}-{count}"
        found.append(name)
    return found
