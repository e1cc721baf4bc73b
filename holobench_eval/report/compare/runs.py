"""A report as ``holoeval compare`` reads it: its records and its provenance."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from ...core.errors import UserError, one_line
from ...study.running import provenance
from ..data.tables import read_records, records_text

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
