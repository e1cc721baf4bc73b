"""Who stands where: the rows of all sources, in groups within which scores compare, and their ranks.

Scores compare for the same display, targets, panel, exposure, metric, protocol and version of the harness. Targets of
one name need not be one image; the score of a constant image, which needs no display, tells: where it differs, the
targets do. A study that lacks what is compared here is a group of its own, and so is one without such a score for every
target. Differences are paired with the baseline of a row's own study: no folder sets the baseline of another.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ...core.errors import listed
from ...study.versions import HARNESS
from ..data.categories import ORACLE
from ..data.phrases import CONSTANT, marked
from ..data.scores import Score
from ..data.statistics import Estimate, mean_interval
from ..data.tables import DONE
from ..data.text import FILES
from .checks import MEASURES
from .displays import Display, digests, display_of
from .intake import OWN, Source

# How far the scores of a constant image may be apart, on two machines, for targets to be the same images.
TOLERANCE_DB, TOLERANCE = 0.02, 0.002
CURRENT, UNRECORDED, ANOTHER = "this version", "version not recorded", "another version"

_SEED = re.compile(r'"seed": -?\d+(, )?')


@dataclass(frozen=True)
class Row:
    """A method on a display in a source.

    label: in its study's tables, and marked, with what must be known of the row; method: its name in configs; values:
    headline score by target, repeats averaged, without holes; planned: targets that should have one; score: the mean;
    baseline: the label that differences are to in its study (empty: none; its own: it is the baseline); gain: to that
    (None: there is none); above: the constant image; table: its row of table.csv; cells: digests of what the numbers
    depend on; rank: None without one; is_further: of a method and parameters that another row of the group stands for;
    also: other studies that hold the very same row.
    """

    source: Source
    display: Display
    label: str
    marked: str
    method: str
    category: str
    metric: Score
    values: Mapping[str, float]
    planned: int
    score: Estimate
    above: Estimate | None
    table: Mapping[str, Any]
    cells: frozenset[str]
    key: tuple[Any, ...]
    baseline: str = ""
    gain: Estimate | None = None
    rank: int | None = None
    is_further: bool = False
    also: tuple[Source, ...] = ()

    @property
    def sources(self) -> tuple[Source, ...]:
        """Every study that holds the row."""
        return (self.source, *self.also)

    @property
    def is_baseline(self) -> bool:
        """Whether differences are to it."""
        return self.baseline == self.label

    @property
    def whose(self) -> str:
        """Whose result it is."""
        return listed(dict.fromkeys(source.by or OWN for source in self.sources))

    @property
    def contestant(self) -> tuple[str, ...]:
        """What is ranked once: a method with its parameters but seeds. A file of one name is another in every lab."""
        lab = self.source.by if ":" in self.method else ""
        return self.method, _SEED.sub("", self.source.parameters.get(self.label) or self.label), lab

    @property
    def failed(self) -> int:
        """Cells without a score."""
        return int(self.table["failed"])

    @property
    def is_complete(self) -> bool:
        """Whether every target has a score: only then is its mean compared."""
        return len(self.values) == self.planned and not self.failed


@dataclass(frozen=True)
class Group:
    """Rows whose scores compare, best first. exposure: of its light; clusters, targets: their numbers; version: see
    ``version``; baselines: the labels that differences are to, by study, each once."""

    number: int
    display: Display
    metric: Score
    measure: str
    panel: str
    exposure: str
    protocol: str
    harness: str
    version: str
    targets: int
    clusters: int
    baselines: tuple[str, ...]
    rows: tuple[Row, ...]

    @property
    def ranked(self) -> dict[str, int]:
        """How many rows are ranked in each category."""
        found = [row.category for row in self.rows if row.rank is not None]
        return {name: found.count(name) for name in dict.fromkeys(found)}


@dataclass
class _Comparable:
    """Rows of one key so far, and the scores of a constant image on their targets."""

    constant: Mapping[str, float]
    rows: list[Row] = field(default_factory=list)


def groups(sources: Sequence[Source]) -> list[Group]:
    """Every row of the sources in its group: those of this version first, the others last."""
    known, found = digests(sources), dict[tuple[Any, ...], list[_Comparable]]()
    for source in sources:
        for row in _rows(source, known):
            constant = _constant(source, row.display.name)
            same = found.setdefault(row.key, [])
            part = next((each for each in same if _equal(each.constant, constant, row.metric)), None)
            if part is None:
                same.append(part := _Comparable(constant))
            part.rows.append(row)
    made = [_group(part.rows) for same in found.values() for part in same]
    made.sort(key=_order)
    return [replace(group, number=number) for number, group in enumerate(made, start=1)]


def version(source: Source, display: Display) -> str:
    """Whether numbers are of this version: their display and recorded harness are those of the package."""
    if display.is_other:
        return ANOTHER
    if source.measure == FILES:
        digest = source.known.get("code_sha256")
        return CURRENT if isinstance(digest, dict) and digest.get("metrics") == HARNESS else ANOTHER
    if source.harness:
        return CURRENT if source.harness == HARNESS else ANOTHER
    return UNRECORDED


def _constant(source: Source, condition: str) -> dict[str, float]:
    results = source.results
    if CONSTANT not in results.floors:
        return {}
    values = results.values(CONSTANT, results.reference(condition))
    return {target: float(value) for target, value in zip(results.targets, values, strict=True) if np.isfinite(value)}


def _equal(a: Mapping[str, float], b: Mapping[str, float], metric: Score) -> bool:
    tolerance = TOLERANCE_DB if metric.unit == "dB" else TOLERANCE
    return all(abs(a[target] - b[target]) <= tolerance for target in a)


def _rows(source: Source, known: Mapping[str, set[str]]) -> list[Row]:
    results, rows = source.results, []
    targets = tuple(sorted(zip(results.targets, map(str, results.clusters), strict=True)))
    for condition in results.conditions:
        display = display_of(source, condition, known)
        verified = _constant(source, condition).keys() == set(results.targets)
        for label in results.methods(condition):
            cells = results.cells(label, condition)
            first, values = cells.iloc[0], results.values(label, condition)
            # A study without floors or harness, or of another person's pictures, is compared with itself alone.
            own = "" if verified and (source.harness or source.measure == FILES) else source.name
            key = (
                source.measure,
                (display.title, display.digest, display.kind),
                condition,
                source.panels.get(condition, ""),
                str(first["exposure"]),
                results.headline.key,
                str(first["protocol"]),
                source.harness,
                (own, source.by, str(source.folder)) if own else (),
                targets,
            )
            rows.append(
                Row(
                    source=source,
                    display=display,
                    label=label,
                    marked=marked(results, label, condition),
                    method=str(first["method"]),
                    category=str(first["category"]),
                    metric=results.headline,
                    values={t: float(v) for t, v in zip(results.targets, values, strict=True) if np.isfinite(v)},
                    planned=len(results.targets),
                    score=results.headline.of(results.row(label, condition)),
                    above=results.above_floor(label, condition),
                    table={str(name): value for name, value in results.row(label, condition).items()},
                    cells=frozenset(cells["cell"]) if (cells["state"] == DONE).all() else frozenset(),
                    key=key,
                )
            )
    return rows


def _group(rows: Sequence[Row]) -> Group:
    merged = _merged(sorted(rows, key=lambda row: (bool(row.source.by), row.source.by, row.source.name)))
    first = merged[0]
    clusters = dict(zip(first.source.results.targets, map(str, first.source.results.clusters), strict=True))
    placed = _ranked([_paired(row, merged, clusters) for row in merged])
    return Group(
        number=0,
        display=first.display,
        metric=first.metric,
        measure=first.source.measure,
        panel=first.source.panels.get(first.display.name, ""),
        exposure=first.key[4],
        protocol=first.key[6],
        harness=first.source.harness,
        version=version(first.source, first.display),
        targets=first.planned,
        clusters=len(set(clusters.values())),
        baselines=tuple(dict.fromkeys(row.baseline for row in placed if row.baseline)),
        rows=tuple(placed),
    )


def _merged(rows: Sequence[Row]) -> list[Row]:
    """The rows, those that two studies have from the very same cells with the same scores once."""
    found: list[Row] = []
    for row in rows:
        same = next((each for each in found if row.cells and _is_same(each, row)), None)
        if same is None:
            found.append(row)
        else:
            found[found.index(same)] = replace(same, also=(*same.also, row.source))
    return found


def _is_same(a: Row, b: Row) -> bool:
    return (a.label, a.cells, a.values) == (b.label, b.cells, b.values)


def _paired(row: Row, rows: Sequence[Row], clusters: Mapping[str, str]) -> Row:
    """The row with its score minus that of the baseline, target by target, of the first of its studies that has one."""
    for source in row.sources if row.is_complete else ():
        for other in rows:
            if source in other.sources and other.label == source.results.layout.baseline and other.is_complete:
                differences = np.array([row.values[target] - other.values[target] for target in clusters])
                gain = None if other is row else mean_interval(differences, list(clusters.values()))
                return replace(row, baseline=other.label, gain=gain)
    return row


def _ranked(rows: Sequence[Row]) -> list[Row]:
    """The rows, best first, each with its place in its category; holes, oracles and further runs have none."""
    ranked: dict[tuple[str, ...], Row] = {}
    for row in rows:
        if row.is_complete and row.category != ORACLE:
            ranked.setdefault(row.contestant, row)
    ordered = sorted(rows, key=lambda row: (not row.values, -row.metric.sign * row.score.mean if row.values else 0.0))
    placed = []
    for row in ordered:
        first = ranked.get(row.contestant)
        if first is not row:
            placed.append(replace(row, is_further=first is not None and row.is_complete))
            continue
        rivals = (each for each in ranked.values() if each.category == row.category)
        rank = 1 + sum(row.metric.better(each.score.mean, row.score.mean) for each in rivals)
        placed.append(replace(row, rank=rank))
    return placed


def _order(group: Group) -> tuple[Any, ...]:
    return (
        (CURRENT, UNRECORDED, ANOTHER).index(group.version),
        group.display.kind != "real",
        MEASURES.index(group.measure),
        -len(group.rows),
        group.display.title,
        group.rows[0].source.name,
        group.exposure,
    )
