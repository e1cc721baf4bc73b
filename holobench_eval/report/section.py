"""What a report is made from, and what a section of it is: a file in ``sections`` and a line in its list."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatch
from functools import cached_property
from pathlib import Path
from typing import Any

from .charts.tiles import Thumbnails
from .data.ranks import Ranks, ranks
from .data.sweeps import Sweep, sweeps
from .data.trainings import Training, trainings
from .description import Description
from .markdown import Markdown, captions
from .results import Results

Blocks = Iterable[object]  # what `markdown.blocks` takes
Figures = Sequence[Markdown]


@dataclass(frozen=True)
class Report:
    """What sections are made from.

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

    def pictures(self, pattern: str, draw: Callable[[], Iterable[tuple[Path, str]]]) -> Iterable[tuple[Path, str]]:
        """(file, caption) of figures made of pictures: drawn, or those of ``pattern`` that an earlier report left."""
        if not self.keeps_pictures:
            return draw()
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

    @cached_property
    def trainings(self) -> list[Training]:
        """Everything that the study had to learn."""
        return trainings(self.results.facts, self.records, self.output)

    @cached_property
    def sweeps(self) -> list[Sweep]:
        """Changes of the displays."""
        return sweeps(self.results)

    @cached_property
    def ranks(self) -> list[Ranks]:
        """Rankings over draws of the displays."""
        return ranks(self.results)


@dataclass(frozen=True)
class Section:
    """A section of the report.

    order: where it stands among the others; details: whether it stands in details.md and not in report.md; render: its
    blocks, from the report and the figures of the section, each a block too, by default these alone; applies: whether
    the report has it; figures: draws its figures, (file, caption) of each.
    """

    name: str
    order: int
    render: Callable[[Report, Figures], Blocks] = lambda report, figures: figures
    applies: Callable[[Report], bool] = lambda report: True
    figures: Callable[[Report], Iterable[tuple[Path, str]]] = lambda report: ()
    details: bool = False
