"""Paired differences of two runs: the same method on the same targets, in one run and in the other."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from ...core.errors import UserError, suggest
from ...study.plan import REFERENCE, is_reference
from ..data.scores import Score, parse
from ..data.statistics import Array, Estimate, family_p, mean_interval
from ..data.tables import DONE, clusters_in, score_columns
from .runs import CELL, Run

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
    clusters = clusters_in(b.records) | clusters_in(a.records)
    groups = both.groupby(["label", f"{OWN}{A}", f"{OWN}{B}"], sort=False)
    rows = _tested([_row(group, score, clusters) for _, group in groups], clusters)
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


def _row(group: pd.DataFrame, score: Score, clusters: Mapping[str, str]) -> Row:
    means = group.groupby("target", sort=False)[[f"value{A}", f"value{B}"]].mean()
    targets = tuple(map(str, means.index))
    a, b = (means[f"value{end}"].to_numpy(dtype=np.float64) for end in (A, B))
    change = mean_interval(b - a, [clusters.get(target, target) for target in targets])
    of_a, of_b = (str(group[f"{OWN}{end}"].iloc[0]) for end in (A, B))
    method = str(group["label"].iloc[0])
    return Row(method, (of_a, of_b), targets, a, b, change, float("nan"), score.higher_is_better)


def _tested(rows: Sequence[Row], clusters: Mapping[str, str]) -> list[Row]:
    """The rows with p values, adjusted for all of them."""
    targets = list(dict.fromkeys(target for row in rows for target in row.targets))
    place = {target: index for index, target in enumerate(targets)}
    differences = np.full((len(rows), len(targets)), np.nan)
    for line, row in zip(differences, rows, strict=True):
        line[[place[target] for target in row.targets]] = row.b - row.a
    p = family_p(differences, [clusters.get(target, target) for target in targets])
    return [replace(row, p=float(value)) for row, value in zip(rows, p, strict=True)]


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
