"""Paired differences of two runs: the same method on the same targets, in one run and in the other.

A run is a report, of which the records and the provenance are read.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from ...core.errors import UserError, one_line, suggest
from ...study.plan import REFERENCE, is_reference
from ...study.running import provenance
from ..results import DONE, clusters_in, read_records, records_text, score_columns
from ..scores import Score, parse
from ..statistics import Array, Estimate, family_p, mean_interval

# What names a cell in records.csv whatever code computed it: the same in two runs of a study.
CELL = ("label", "condition", "target", "repeat")
# What the provenance of a run says about its numbers; packages and displays are listed one by one.
_FACTS = ("package", "revision", "dirty", "harness", "config", "config_sha256", "python", "platform", "cpu", "device")
_UNKNOWN = "not recorded"


@dataclass(frozen=True)
class Run:
    """A report: its folder, its records (``tables.read_records``) and its provenance (empty: there is none)."""

    folder: Path
    records: pd.DataFrame
    provenance: Mapping[str, Any]


def read_run(folder: Path) -> Run:
    """Read a report. UserError: the folder holds no records.csv, or one that names a cell twice."""
    try:
        text = records_text(folder / "records.csv")
    except (FileNotFoundError, NotADirectoryError):
        raise UserError(f"{folder}: no records.csv in this folder; expected the folder of a report") from None
    return Run(folder, records_of(folder, text), provenance.read(folder))


def records_of(folder: Path, text: str) -> pd.DataFrame:
    """The records in the text of the records.csv of a folder. UserError: it is none, or names a cell twice."""
    try:
        records = read_records(text)
    except (UserError, ValueError) as error:
        raise UserError(f"{folder}: {error}") from None
    twice = records[records.duplicated(list(CELL))]
    if len(twice):
        named = ", ".join(str(twice.iloc[0][column]) for column in CELL[:3])
        raise UserError(f"{folder / 'records.csv'}: two rows for one cell ({named}); expected a row a cell")
    return records


def provenance_differences(a: Run, b: Run) -> list[tuple[str, str, str]]:
    """(fact, in A, in B) for every fact of the two provenances that differs."""
    facts = [dict(_facts(run.provenance)) for run in (a, b)]
    names = dict.fromkeys([*facts[0], *facts[1]])
    pairs = ((name, *(known.get(name, _UNKNOWN) for known in facts)) for name in names)
    return [(name, first, second) for name, first, second in pairs if first != second]


def _facts(known: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    for name in (*_FACTS, "gpu", "threads"):
        if known.get(name) is not None:
            yield name.replace("_", " "), one_line(str(known[name]))
    for group, entries in (("package", known.get("packages")), ("display", known.get("profiles"))):
        for name, value in entries.items() if isinstance(entries, Mapping) else ():
            yield one_line(f"{group} {name}"), one_line(_version(value))


def _version(value: Any) -> str:
    """A package's version, or the version and digest of a display's profile."""
    if not isinstance(value, Mapping):
        return str(value)
    return f"version {value.get('version')}, sha256 {str(value.get('sha256'))[:12]}"


A, B = "_in_a", "_in_b"  # ends of the columns of paired cells
EQUAL = "equal"  # the verdict of rows in which no target has changed
OWN = "own_display"  # the name of a display in its run, where it is paired with another


@dataclass(frozen=True)
class Row:
    """A method on a display in both runs.

    displays: its name in A and in B; targets: those with a score in both; a, b: ``(targets,)`` scores, repeats
    averaged; change: mean of b - a with its interval over clusters; p: adjusted for all rows (NaN: no test);
    higher_is_better: direction of the score.
    """

    method: str
    displays: tuple[str, str]
    targets: tuple[str, ...]
    a: Array
    b: Array
    change: Estimate
    p: float
    higher_is_better: bool

    @property
    def gain(self) -> float:
        """The mean change, positive where B is better."""
        return self.change.mean if self.higher_is_better else -self.change.mean

    @property
    def verdict(self) -> str:
        """``worse`` or ``better`` where the interval is clear of zero, else ``not shown``.

        ``equal``: no target has changed; ``too few clusters``: there is no interval.
        """
        if not np.any(self.b - self.a):
            return EQUAL
        if np.isnan(self.change.low):
            return "too few clusters"
        return ("better" if self.gain > 0 else "worse") if self.change.is_clear else "not shown"

    @property
    def display(self) -> str:
        """The display, or both where they are different."""
        first, second = self.displays
        return first if first == second else f"{first} = {second}"


@dataclass(frozen=True)
class Unpaired:
    """Cells of a method on a display that have a score in one run alone.

    run: ``A`` or ``B``; cells: their number; why: what the other run has in their place.
    """

    run: str
    method: str
    display: str
    cells: int
    why: str


@dataclass(frozen=True)
class Comparison:
    """Two runs by one score.

    rows: regressions first, equal ones last; unpaired: what only one of them has; cells, unchanged: paired cells, and
    those of them with one identity in both runs, so that only the machine and undeclared changes of the code can make a
    difference.
    """

    a: Run
    b: Run
    score: Score
    rows: tuple[Row, ...]
    unpaired: tuple[Unpaired, ...]
    cells: int
    unchanged: int

    def moved(self, count: int) -> list[tuple[Row, str, float, float]]:
        """(row, target, score in A, in B) where they differ most, largest change first."""
        each = [
            (row, target, float(a), float(b))
            for row in self.rows
            for target, a, b in zip(row.targets, row.a, row.b, strict=True)
            if a != b
        ]
        return sorted(each, key=lambda moved: -abs(moved[3] - moved[2]))[:count]

    def regressions(self, limit: float) -> list[Row]:
        """Rows whose mean is worse by more than ``limit``, in the unit of the score, with an interval clear of zero."""
        return [row for row in self.rows if row.verdict == "worse" and -row.gain > limit]


def compare(a: Run, b: Run, metric: str | None = None, displays: Mapping[str, str] | None = None) -> Comparison:
    """Compare two runs cell by cell.

    Parameters
    ----------
    a, b
        See ``runs.read_run``.
    metric
        Score key, such as ``ssim_linear``. None: the first that both have, in the order of the tables.
    displays
        Display of A: display of B whose cells are paired. None: displays of the same name.

    Returns
    -------
    Comparison
        Differences are B - A.

    Raises
    ------
    UserError
        The runs have no such score or display, or no scored cell in common.
    """
    score = _score(a, b, metric)
    names = _displays(a, b, displays)
    first, second = _cells(a, score, names), _cells(b, score, {name: name for name in names.values()})
    both = _scored(first).merge(_scored(second), on=list(CELL), suffixes=(A, B))
    if both.empty:
        raise UserError(
            f"{a.folder} and {b.folder}: no scored cell in common (paired by method, display, target and repeat); "
            "--displays A=B pairs displays of different names"
        )
    rows = _rows(both, score, clusters_in(b.records) | clusters_in(a.records))
    rows.sort(key=lambda row: (row.verdict == EQUAL, row.verdict != "worse", row.gain))
    unpaired = (*_unpaired("A", first, second), *_unpaired("B", second, first))
    unchanged = int((both[f"cell{A}"] == both[f"cell{B}"]).sum())
    return Comparison(a, b, score, tuple(rows), unpaired, len(both), unchanged)


def _score(a: Run, b: Run, metric: str | None) -> Score:
    of_b = set(score_columns(b.records))
    common = [parse(name).key for name in score_columns(a.records) if name in of_b]
    if not common:
        raise UserError(f"{a.folder} and {b.folder}: no score in common")
    if metric is not None and metric not in common:
        raise UserError(f"--metric {metric}: not a score of both runs; {suggest(metric, common)}")
    return parse(metric or common[0])


def _displays(a: Run, b: Run, displays: Mapping[str, str] | None) -> dict[str, str]:
    """Display of A: display of B; reference rows, which no display shows, go with the display of their targets."""
    of_a, of_b = ({str(name) for name in run.records["condition"]} for run in (a, b))
    if displays is None:
        names = {name: name for name in sorted(of_a | of_b) if not is_reference(name)}
        return names | _references(a, b, names)
    for name, known, run in [*((n, of_a, a) for n in displays), *((n, of_b, b) for n in displays.values())]:
        if name not in known:
            shown = [other for other in known if not is_reference(other)]
            raise UserError(f"--displays: {run.folder} has no display '{name}'; {suggest(name, shown)}")
    if len(set(displays.values())) < len(displays):
        raise UserError("--displays: two displays of A are paired with one of B; expected a display of B for each")
    return {**displays, **_references(a, b, displays)}


def _references(a: Run, b: Run, names: Mapping[str, str]) -> dict[str, str]:
    """Reference rows of A: those of B for the display that is paired with theirs, else for the first displays."""
    of_a, of_b = (
        {
            str(display): str(name)
            for display, name in run.records[["display", "condition"]].to_numpy()
            if is_reference(name)
        }
        for run in (a, b)
    )
    paired = {mine: of_b[names[display]] for display, mine in of_a.items() if names.get(display) in of_b}
    if REFERENCE not in paired and REFERENCE not in paired.values():
        paired[REFERENCE] = REFERENCE
    return paired


def _cells(run: Run, score: Score, names: Mapping[str, str]) -> pd.DataFrame:
    """The cells of a run on the displays that are compared, a row each, the displays under their names in B."""
    rows = run.records[run.records["condition"].isin(names)]
    columns = {name: rows[name] for name in (*CELL, "cell", "state", "reason")}
    values = rows[score.column].where(rows["state"] == DONE)
    return pd.DataFrame({**columns, "condition": rows["condition"].map(names), OWN: rows["condition"], "value": values})


def _scored(cells: pd.DataFrame) -> pd.DataFrame:
    return cells[cells["value"].notna()]


def _rows(both: pd.DataFrame, score: Score, clusters: Mapping[str, str]) -> list[Row]:
    """A row for each method and pair of displays, with p values that are adjusted for all of them."""
    keys = ["label", f"{OWN}{A}", f"{OWN}{B}"]
    means = both.groupby([*keys, "target"], sort=False)[[f"value{A}", f"value{B}"]].mean()
    groups, order = list(means.groupby(level=keys, sort=False)), means.index.get_level_values("target").unique()
    # unstack(sort=False) of pandas before 3 puts values under other targets where a method has holes.
    differences = (means[f"value{B}"] - means[f"value{A}"]).unstack("target")
    differences = differences.reindex(index=[name for name, _ in groups], columns=order)
    adjusted = family_p(differences.to_numpy(), [clusters[str(target)] for target in order])
    found = []
    for ((method, of_a, of_b), group), p in zip(groups, adjusted, strict=True):
        targets = tuple(map(str, group.index.get_level_values("target")))
        first, second = group.to_numpy(dtype=np.float64).T
        change = mean_interval(second - first, [clusters[target] for target in targets])
        names = str(of_a), str(of_b)
        found.append(Row(str(method), names, targets, first, second, change, float(p), score.higher_is_better))
    return found


def _unpaired(run: str, cells: pd.DataFrame, others: pd.DataFrame) -> Iterator[Unpaired]:
    """What has a score in one run alone: ``cells`` of that run, ``others`` of the other one."""
    pairs = set(zip(others["label"], others["condition"], strict=True))
    beside = _scored(cells).merge(others, on=list(CELL), how="left", suffixes=("", "_other"))
    alone = beside[beside["value_other"].isna()]
    for (method, display), group in alone.groupby(["label", "condition"], sort=False):
        states = group[group["state_other"].notna()]
        why = "no such target or repeat"
        if (method, display) not in pairs:
            why = "no such row"
        elif len(states):
            why = f"{states['state_other'].iloc[0]}: {states['reason_other'].iloc[0] or 'no score of this name'}"
        yield Unpaired(run, str(method), str(group[OWN].iloc[0]), len(group), why)
