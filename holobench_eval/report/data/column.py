"""What a column of a file is, and how the cells of a row become its value in table.csv."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import pandas as pd

from .layout import Layout

Kind = Literal["text", "number", "count"]  # count: a whole number
Record = Mapping[str, Any]  # as ``study.store.Store.load`` gives it
DONE = "done"
_UNITS = {"px": "px", "s": "s", "mib": "MiB"}


@dataclass(frozen=True)
class Cells:
    """The cells behind a row of the table."""

    cells: pd.DataFrame
    layout: Layout

    @cached_property
    def done(self) -> pd.DataFrame:
        """Those with a score."""
        return self.cells[self.cells["state"] == DONE]


def first(cells: Cells, name: str) -> Any:
    """Of cells that all have one value."""
    return cells.cells[name].iloc[0]


def mean(cells: Cells, name: str) -> float:
    """Over the done cells."""
    return float(cells.done[name].mean())


def median(cells: Cells, name: str) -> float:
    """Over the done cells."""
    return float(cells.done[name].median())


def if_known(frame: pd.DataFrame, name: str, layout: Layout) -> bool:
    """Whether any record has a value."""
    values = frame[name]
    return bool((values.notna() & (values != "")).any())


def if_trained(frame: pd.DataFrame, name: str, layout: Layout) -> bool:
    """Whether the study trains a method."""
    return bool(layout.trained)


@dataclass(frozen=True)
class Column:
    """A column of the files.

    Parameters
    ----------
    name
        With its unit.
    meaning, kind, unit
        Of its values, for columns.md; the unit is empty for text and pure numbers.
    source
        Its value in records.csv, from a record and the layout of its study (None: not there).
    is_of_study
        Whether it follows from the config: its source is given the row so far in the place of the record, and gives it
        anew where records.csv is read.
    kept
        Whether a frame keeps the column, from all of its columns and the name (None: always, and it has to be in a file
        that is read).
    table
        Its value in table.csv, from the cells of a row and the column's name (None: not there).
    table_meaning
        Of its values there, where it is not that of records.csv.
    heading
        In the tables of the report and the page that say what a row took, ``{each}`` being what a method makes for a
        target (empty: in none).
    """

    name: str
    meaning: str
    kind: Kind = "text"
    unit: str = ""
    source: Callable[..., Any] | None = None
    is_of_study: bool = False
    kept: Callable[[pd.DataFrame, str, Layout], bool] | None = None
    table: Callable[[Cells, str], Any] | None = None
    table_meaning: str = ""
    heading: str = ""


def column(columns: list[Column], kind: Kind = "text", **more: Any) -> Callable[[Callable[..., Any]], None]:
    """Add a column to a list: named like the function that gives its value, with the docstring as its meaning.

    more: further fields of the column; with ``source=None`` the function gives the value in table.csv alone, from the
    cells of a row and the column's name.
    """

    def add(value: Callable[..., Any]) -> None:
        name, meaning = value.__name__, " ".join(str(value.__doc__).split()).removesuffix(".")
        own = {"source": value} if "source" not in more else {"table": value}
        given = {"meaning": meaning, "unit": _UNITS.get(name.rpartition("_")[2], ""), **own, **more}
        columns.append(Column(name, kind=kind, **given))

    return add
