"""What a report is made from, and what its stories give to it: the parts of report.md and details.md."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatch
from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar, cast

from .charts.tiles import Thumbnails
from .description import Description
from .markdown import Markdown, captions
from .results import Results
from .statistics import FEWEST_DISPLAYS

Blocks = Iterable[object]  # what `markdown.blocks` takes
Figures = Sequence[Markdown]
T = TypeVar("T")


@dataclass(frozen=True)
class Report:
    """What parts are made from.

    records: one for every planned cell; output: the folder of the report, with thumbnails in ``records``; provenance:
    see ``study.running.provenance``; keeps_pictures: whether the figures made of pictures are those that an earlier
    report left, as thumbnails are not there to draw them from; drawn: the folder of the figures where it is none of the
    report's.
    """

    results: Results
    records: Sequence[Mapping[str, Any]]
    output: Path
    provenance: Mapping[str, Any]
    description: Description
    keeps_pictures: bool = False
    drawn: Path | None = None
    _known: dict[Callable[[Any], Any], Any] = field(default_factory=dict, init=False)

    def once(self, make: Callable[[Report], T]) -> T:
        """What a function makes of the report, made once for all parts."""
        if make not in self._known:
            self._known[make] = make(self)
        return cast(T, self._known[make])

    def pictures(
        self, pattern: str, draw: Callable[[Report], Iterable[tuple[Path, str]]]
    ) -> Iterable[tuple[Path, str]]:
        """(file, caption) of figures made of pictures: drawn, or those of ``pattern`` that an earlier report left."""
        if not self.keeps_pictures:
            return draw(self)
        if self.drawn is not None:
            return []
        known = ((self.figures / name, Markdown(text)) for name, text in captions(self.output).items())
        return [(path, text) for path, text in known if fnmatch(path.name, pattern) and path.is_file()]

    @property
    def figures(self) -> Path:
        """The folder of the figures."""
        return self.drawn or self.output / "figures"

    @cached_property
    def thumbnails(self) -> Thumbnails:
        """Pictures of targets and captures."""
        return Thumbnails(self.results, self.output)


@dataclass(frozen=True)
class Part:
    """A part of the report.

    order: where it stands among the others; render: its blocks, from the report and its figures, each a block too, by
    default these alone; applies: whether the report has it; figures: draws its figures, (file, caption) of each;
    details: whether it stands in details.md and not in report.md.
    """

    order: int
    render: Callable[[Report, Figures], Blocks] = lambda report, figures: figures
    applies: Callable[[Report], bool] = lambda report: True
    figures: Callable[[Report], Iterable[tuple[Path, str]]] = lambda report: ()
    details: bool = False


def subjects(results: Results) -> list[str]:
    """The methods that the question names, in its order, without baseline and oracles: those it is about."""
    aside = {results.baseline, *results.facts.oracles}
    return [label for label in mentioned(results.labels, results.study.question) if label not in aside]


def mentioned(names: Iterable[str], text: str) -> list[str]:
    """The names that stand in a text, in its order; the longest counts where one begins another."""
    longest = sorted(set(names), key=lambda name: (-len(name), name))
    pattern = "|".join(rf"(?<![\w-]){re.escape(name)}(?![\w-])" for name in longest)
    return list(dict.fromkeys(match[0] for match in re.finditer(pattern, text))) if longest else []


def is_many(results: Results) -> bool:
    """Whether a study asks about displays and not about each: it has many, those that are a change of another aside."""
    return len(results.conditions) >= FEWEST_DISPLAYS
