"""Two reports side by side: their records merged by cell, as tables in Markdown, on a console and in compare.csv."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from ..core.errors import UserError, one_line, suggest
from ..study.plan import REFERENCE, is_reference
from ..study.running import provenance
from .markdown import Markdown, blocks, heading, table
from .results import DONE, clusters_in, csv_text, read_records, records_text, score_columns
from .scores import Score, parse
from .statistics import Estimate, family_p, mean_interval
from .text import bracketed, words

# What names a cell in records.csv whatever code computed it: the same in two runs of a study.
CELL = ("label", "condition", "target", "repeat")
TARGETS = 10  # that changed most, in the list
EQUAL = "equal"  # the verdict of rows in which no target has changed
# The columns of compare.csv.
COLUMNS = ["method", "display_a", "display_b", "score", "unit", "targets", "clusters", "mean_a", "mean_b",
           "difference", "difference_low", "difference_high", "p_adjusted", "verdict"]  # fmt: skip
# What the provenance of a run says about its numbers; packages and displays are listed after them.
_FACTS = ("package", "revision", "dirty", "harness", "config", "config_sha256", "python", "platform", "cpu", "device",
          "gpu", "threads")  # fmt: skip


Part = tuple[str, str, pd.DataFrame]  # a table: its title, a sentence, and rows of plain text, which may be none
Runs = tuple[pd.DataFrame, pd.DataFrame]  # the records of A and B


@dataclass(frozen=True)
class Comparison:
    """Two reports by one score; differences are B - A.

    rows: a method on a display each, regressions first, equal ones last, with the columns of compare.csv and those of
    the first table; unpaired: how many cells have a score in one run alone, and why; parts: the tables; markdown, csv:
    the texts of compare.md and compare.csv.
    """

    rows: pd.DataFrame
    unpaired: pd.DataFrame
    parts: tuple[Part, ...]
    markdown: str
    csv: str


def read_run(folder: Path) -> pd.DataFrame:
    """The records of a report. UserError: its folder holds no records.csv, or one that names a cell twice."""
    try:
        text = records_text(folder / "records.csv")
    except (FileNotFoundError, NotADirectoryError):
        raise UserError(f"{folder}: no records.csv in this folder; expected the folder of a report") from None
    try:
        records = read_records(text)
    except (UserError, ValueError) as error:
        raise UserError(f"{folder}: {error}") from None
    twice = records[records.duplicated(list(CELL))]
    if len(twice):
        named = ", ".join(str(twice.iloc[0][column]) for column in CELL[:3])
        raise UserError(f"{folder / 'records.csv'}: two rows for one cell ({named}); expected a row a cell")
    return records


def compare(a: Path, b: Path, metric: str | None = None, displays: Mapping[str, str] | None = None) -> Comparison:
    """Compare two reports cell by cell.

    Parameters
    ----------
    a, b
        Their folders.
    metric
        Score key, such as ``ssim_linear``. None: the first that both have, in the order of the tables.
    displays
        Display of A: display of B whose cells are paired. None: displays of the same name.

    Raises
    ------
    UserError
        A report is damaged, or the two have no such score or display, or no scored cell in common.
    """
    folders, runs = (a, b), (read_run(a), read_run(b))
    common = [parse(name).key for name in score_columns(runs[0]) if name in runs[1]]
    if not common:
        raise UserError(f"{a} and {b}: no score in common")
    if metric is not None and metric not in common:
        raise UserError(f"--metric {metric}: not a score of both runs; {suggest(metric, common)}")
    score = parse(metric or common[0])
    names = _displays(folders, runs, displays or {})
    of_a, of_b = _cells(runs[0], score, names), _cells(runs[1], score, {name: name for name in names.values()})
    cells = of_a.merge(of_b, on=list(CELL), how="outer", suffixes=("_a", "_b"))
    both = cells.dropna(subset=["mean_a", "mean_b"]).sort_values("place_a")
    if both.empty:
        raise UserError(
            f"{a} and {b}: no scored cell in common (paired by method, display, target and repeat); "
            "--displays A=B pairs displays of different names"
        )
    rows, targets = _rows(both, score, clusters_in(runs[1]) | clusters_in(runs[0]))
    alone = [*_unpaired(cells, "a", "b"), *_unpaired(cells, "b", "a")]
    unpaired = pd.DataFrame(alone, columns=["run", "method", "display", "cells", "in the other run"])
    which = "Cells with a score in one run alone. They are in no mean above." if alone else "Nothing."
    parts = (
        _differences(rows, both, score, runs, folders),
        _targets(targets, score),
        ("Only in one run", which, unpaired),
        _provenance({"A": provenance.read(a), "B": provenance.read(b)}),
    )
    page: list[object] = [heading(Markdown("{} and {}").format(a.name, b.name), level=1)]
    for title, sentence, text in parts:
        page += [heading(title), sentence, table(list(text), text.to_numpy().tolist()) if len(text) else None]
    return Comparison(rows, unpaired, parts, f"{blocks(page)}\n", csv_text(rows[COLUMNS]))


def _displays(folders: Sequence[Path], runs: Runs, displays: Mapping[str, str]) -> dict[str, str]:
    """Display of A: display of B; reference rows, which no display shows, go with the display of their targets.

    Where no display of theirs is paired, those of the first displays go together.
    """
    known = [[name for name in run["condition"].unique() if not is_reference(name)] for run in runs]
    for pair in displays.items():
        for folder, of_run, name in zip(folders, known, pair, strict=True):
            if name not in of_run:
                raise UserError(f"--displays: {folder} has no display '{name}'; {suggest(name, of_run)}")
    if len(set(displays.values())) < len(displays):
        raise UserError("--displays: two displays of A are paired with one of B; expected a display of B for each")
    names = dict(displays) or {name: name for name in known[0] + known[1]}
    rows = (zip(run["display"], run["condition"], strict=True) for run in runs)
    of_a, of_b = ({display: name for display, name in pairs if is_reference(name)} for pairs in rows)
    paired = {name: of_b[names[display]] for display, name in of_a.items() if names.get(display) in of_b}
    if REFERENCE not in paired and REFERENCE not in paired.values():
        paired[REFERENCE] = REFERENCE
    return names | paired


def _cells(run: pd.DataFrame, score: Score, names: Mapping[str, str]) -> pd.DataFrame:
    """The cells on the displays that are compared, under their names in B; ``display``: in this run."""
    rows = run.loc[run["condition"].isin(names), [*CELL, "cell", "state", "reason"]]
    rows = rows.assign(display=rows["condition"], condition=rows["condition"].map(names), place=rows.index)
    return rows.assign(mean=run[score.column].where(run["state"] == DONE))


def _rows(both: pd.DataFrame, score: Score, clusters: Mapping[str, str]) -> tuple[pd.DataFrame, pd.DataFrame]:
    """The rows of a comparison, with p values that are adjusted for all of them, and the targets of all in their order.

    Repeats of a target are averaged.
    """
    both, keys = both.rename(columns={"label": "method"}), ["method", "display_a", "display_b"]
    targets = both.groupby([*keys, "target"], sort=False)[["mean_a", "mean_b"]].mean()
    targets["difference"] = targets["mean_b"] - targets["mean_a"]
    by_target = targets["difference"].unstack()
    p = family_p(by_target.to_numpy(), [clusters[str(target)] for target in by_target])
    targets = targets.reset_index("target")
    groups = targets.groupby(level=keys, sort=False)
    changes = [mean_interval(own["difference"].to_numpy(), [*own["target"].map(clusters)]) for _, own in groups]
    index = pd.MultiIndex.from_tuples([key for key, _ in groups], names=keys)
    names = {"n": "targets", "mean": "difference", "low": "difference_low", "high": "difference_high"}
    estimates = pd.DataFrame(changes, index)
    gain, clear = score.sign * estimates["mean"], (estimates["low"] > 0) | (estimates["high"] < 0)
    verdicts = {
        EQUAL: ~groups["difference"].any(),
        "too few clusters": estimates["low"].isna(),
        "not shown": ~clear,
        "better": gain > 0,
    }
    rows = estimates.rename(columns=names).assign(
        **{name: [own[name].to_numpy().mean() for _, own in groups] for name in ("mean_a", "mean_b")},
        score=score.key,
        unit=score.unit,
        p_adjusted=pd.Series(p, by_target.index),
        verdict=np.select(list(verdicts.values()), list(verdicts), "worse"),
        display=[of_a if of_a == of_b else f"{of_a} = {of_b}" for _, of_a, of_b in index],
    )
    rows = rows.iloc[np.lexsort((gain, rows["verdict"].map({"worse": 0, EQUAL: 2}).fillna(1)))]
    return rows.reset_index(), rows[["display"]].join(targets).reset_index()


def _unpaired(cells: pd.DataFrame, run: str, other: str) -> Iterator[tuple[str, ...]]:
    """What has a score in one run alone, and what the other one has in its place."""
    pairs = cells.dropna(subset=f"state_{other}").groupby(["label", "condition"]).groups
    alone = cells[cells[f"mean_{run}"].notna() & cells[f"mean_{other}"].isna()].sort_values(f"place_{run}")
    for (method, display), group in alone.groupby(["label", "condition"], sort=False):
        there = group.dropna(subset=f"state_{other}")
        why = "no such target or repeat" if (method, display) in pairs else "no such row"
        if len(there):
            why = f"{there[f'state_{other}'].iloc[0]}: {there[f'reason_{other}'].iloc[0] or 'no score of this name'}"
        yield run.upper(), str(method), group[f"display_{run}"].iloc[0], str(len(group)), why


def _differences(rows: pd.DataFrame, both: pd.DataFrame, score: Score, runs: Runs, folders: Sequence[Path]) -> Part:
    counts = rows["verdict"].value_counts(sort=False)
    listed = ", in which no target has changed and which are not listed" if EQUAL in counts else ""
    same = int((both["cell_a"] == both["cell_b"]).sum())
    sentence = (
        f"A is {folders[0]}, B is {folders[1]}. Differences of {score.heading} are B - A over the targets with a score "
        "in both, with 95 % intervals over clusters of targets. Rows: "
        f"{words([f'{count} {verdict}' for verdict, count in counts.items()])}{listed}. Worse and better mean that the "
        "interval is clear of zero, and not shown that it is not; intervals are not adjusted for the number of rows, "
        f"the p values in compare.csv are. Of {len(both)} paired cells, {'all' if same == len(both) else same} have "
        "one identity in both runs: the same settings, target, display and declared versions of the code."
    )
    first, second = (words(sorted(run["protocol"].unique())) for run in runs)
    if first != second:
        sentence += f" A is scored by metric protocol {first} and B by {second}."
    changed = rows[rows["verdict"] != EQUAL]
    ends = changed[["difference", "difference_low", "difference_high", "targets", "clusters"]].itertuples(index=False)
    text = _text(changed, ["method", "display", "targets"], itertools.starmap(Estimate, ends), score)
    return "Differences", sentence, text.assign(verdict=changed["verdict"])


def _text(rows: pd.DataFrame, names: list[str], changes: Iterable[Estimate], score: Score) -> pd.DataFrame:
    """Names and numbers as text. Runs may differ by less than the digits of a score show."""
    form = f"+z.{len(score.number(0.0).partition('.')[2]) + 1}f"
    text = rows[names].astype(str).assign(A=rows["mean_a"].map(score.number), B=rows["mean_b"].map(score.number))
    return text.assign(**{"B - A": [bracketed(change, form) for change in changes]})


def _targets(targets: pd.DataFrame, score: Score) -> Part:
    """The targets that changed most, largest change first."""
    most = targets[targets["difference"] != 0]
    most = most.sort_values("difference", key=lambda by: -by.abs(), kind="stable")[:TARGETS]
    changes = (mean_interval([change]) for change in most["difference"])  # one target has no interval
    text = _text(most, ["target", "method", "display"], changes, score)
    sentence = f"The {len(most)} largest changes of a target." if len(most) else "No target has changed."
    return "Targets that changed most", sentence, text


def _provenance(known: Mapping[str, Mapping[str, Any]]) -> Part:
    facts = pd.DataFrame({run: dict(_facts(each)) for run, each in known.items()}, dtype=object).fillna("not recorded")
    rows = facts[facts["A"] != facts["B"]].rename_axis("fact").reset_index()
    sentence = "What the two runs were computed with, where it differs." if len(rows) else "No recorded fact differs."
    if lacking := [run for run, each in known.items() if not each]:
        sentence = f"{words(lacking)} {'has' if len(lacking) == 1 else 'have'} no provenance.json. {sentence}"
    return "Provenance", sentence, rows


def _facts(known: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    for name in _FACTS:
        if known.get(name) is not None:
            yield name.replace("_", " "), one_line(str(known[name]))
    for group, entries in (("package", known.get("packages")), ("display", known.get("profiles"))):
        for name, value in entries.items() if isinstance(entries, Mapping) else ():
            if isinstance(value, Mapping):  # of a display's profile
                value = f"version {value.get('version')}, sha256 {str(value.get('sha256'))[:12]}"
            yield one_line(f"{group} {name}"), one_line(str(value))
