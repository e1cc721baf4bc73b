"""A folder on its way into the site: its records and provenance, read and checked.

Folders come from anybody. Nothing of them is run, no config is opened, and what does not pass is a ``UserError`` in one
line. What lies below the folder of own reports is own. Any other folder says whose it is by the key ``by`` of its
provenance, and has to say the harness that its numbers come from.
"""

from __future__ import annotations

import io
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import pandas as pd

from ...core.errors import UserError
from ...study.running import provenance
from ..compare.runs import records_of
from ..data.categories import CALIBRATED, CATEGORIES, FLOOR, ONLINE, OPEN_LOOP, ORACLE
from ..data.layout import Layout, network_of
from ..data.results import Results
from ..data.scores import METRICS, Score, parse
from ..data.tables import GUARDED, clusters_in, records_text, score_columns
from . import checks
from .checks import LONGEST, RECORDS, folded

TABLE: Final = "table.csv"
TESTS: Final = "tests.csv"
BY = "by"  # the key of a provenance that says whose results they are
OWN = "own"  # how the site calls results of whoever makes it
MOST_FILE = 8_000_000  # bytes of a picture or a text


@dataclass(frozen=True)
class Source:
    """A folder that was taken in.

    by: whose results they are (empty: of whoever makes the site); results: its numbers without changed displays; known:
    its provenance; changed: conditions that are a change of a display.
    """

    folder: Path
    by: str
    results: Results
    known: Mapping[str, Any]
    changed: int

    @property
    def name(self) -> str:
        """Of the study."""
        return self.folder.resolve().name

    @property
    def processor(self) -> str:
        """What the seconds were taken on."""
        return str(self.known.get("gpu") or self.known.get("cpu") or "processor not recorded")


def folders(given: Sequence[Path]) -> tuple[list[Path], list[Path]]:
    """The folders of reports, and those beside them that hold none. UserError: no report in one of those given."""
    found: dict[Path, Path] = {}
    without: list[Path] = []
    for folder in given:
        if not folder.is_dir():
            raise UserError(f"{folder}: no such folder; expected a report, or a folder of reports")
        below = sorted(path for path in folder.iterdir() if path.is_dir() and not path.name.startswith("."))
        reports = [folder] if _is_report(folder) else [path for path in below if _is_report(path)]
        if links := [path for path in reports if path.is_symlink() and path != folder]:
            raise UserError(f"{links[0]}: a link; expected a folder, or name the report itself")
        if not reports:
            raise UserError(
                f"{folder}: no report in it; expected {RECORDS} and {provenance.FILE}, here or a level below"
            )
        without += [path for path in below if path not in reports and reports != [folder]]
        found |= {path.resolve(): path for path in reports if path.resolve() not in found}
    return list(found.values()), without


def _is_report(folder: Path) -> bool:
    return any((folder / name).exists() or (folder / name).is_symlink() for name in (RECORDS, provenance.FILE))


def read(folder: Path, own: Path) -> Source:
    """Take in a folder. own: below it are own reports. UserError: what is wrong, and what would be right."""
    _check_file(folder / RECORDS)
    _check_file(folder / provenance.FILE)
    known, raw = _known(folder), _texts(folder / RECORDS)
    by = _whose(folder, known, own)
    checks.check_names(folder, raw)
    frame = records_of(folder, records_text(folder / RECORDS))
    checks.check_provenance(folder, known, strict=bool(by))
    checks.check_columns(folder, frame)
    checks.check_rows(folder, raw, frame)
    displays = frame.loc[(frame["condition"] == frame["display"]) & (frame["category"] != FLOOR), "condition"]
    nominal = frame[(frame["category"] == FLOOR) | frame["condition"].isin(displays)].reset_index(drop=True)
    if displays.empty:
        raise UserError(
            f"{folder / RECORDS}: no row of an unchanged display; expected rows whose condition is a display"
        )
    checks.check_displays(folder, known, nominal)
    headline, baseline = _tested(folder, nominal)
    results = Results(nominal, _layout(folder, nominal, headline.key, baseline))
    if results.layout.measure != "error_budget":  # which is made of further scores than those that a site shows
        kept = {score.column for score in (headline, *results.beside)}
        results = replace(results, frame=nominal.drop(columns=[*{*score_columns(nominal)} - kept]))
    return Source(folder, by, results, known, frame["condition"].nunique() - nominal["condition"].nunique())


def text_of(path: Path) -> str:
    """The text of a file of a folder; empty where there is none, or a link, or too large a one."""
    is_readable = path.is_file() and not path.is_symlink() and path.stat().st_size <= MOST_FILE
    return path.read_text(encoding="utf-8", errors="replace") if is_readable else ""


def _check_file(path: Path) -> None:
    if path.is_symlink() or not path.is_file():
        what = "a link" if path.is_symlink() else "missing"
        raise UserError(f"{path}: {what}; a folder of results holds {RECORDS} and {provenance.FILE} as files")


def _known(folder: Path) -> dict[str, Any]:
    try:
        known = provenance.read(folder)
        json.dumps(known, ensure_ascii=False, allow_nan=False).encode()
    except (RecursionError, ValueError):
        wrong = "nested too deeply, not Unicode, or not finite"
        raise UserError(f"{folder / provenance.FILE}: {wrong}; expected that of 'holoeval run'") from None
    return known


def _texts(path: Path) -> pd.DataFrame:
    """Every cell of a file of numbers as text, without the apostrophes before formulas."""
    try:
        frame = pd.read_csv(io.StringIO(records_text(path)), dtype=str, keep_default_na=False)
    except ValueError as error:
        reason = " ".join(str(error).split())
        raise UserError(f"{path}: not a table ({reason}); write it with 'holoeval report'") from None
    return frame.replace(GUARDED, r"\1", regex=True)


def _whose(folder: Path, known: Mapping[str, Any], own: Path) -> str:
    """Whose results they are: own ones (empty) lie below ``own``, and name nobody."""
    by, path = known.get(BY, ""), folder / provenance.FILE
    if not isinstance(by, str) or len(by) > LONGEST or not by.isprintable() or (BY in known and not by.strip()):
        raise UserError(f'{path}: "{BY}" is not a name; expected a text, such as "{BY}": "Our lab"')
    if folded(by) == OWN:
        raise UserError(f'{path}: "{BY}" is {by!r}, which nobody is called here; expected a name, such as "Our lab"')
    if not by and not folder.resolve().is_relative_to(own.resolve()):
        raise UserError(
            f'{path}: lacks "{BY}", whose results these are; add it, such as "{BY}": "Our lab" (own ones lie below '
            f"{own}, see --own)"
        )
    return by


def _tested(folder: Path, frame: pd.DataFrame) -> tuple[Score, str | None]:
    """Score and baseline of the study's paired tests; without tests.csv the first score, and no baseline."""
    scores, path = [parse(name) for name in score_columns(frame)], folder / TESTS
    tests = pd.DataFrame(columns=["metric", "baseline"])
    if path.exists():
        _check_file(path)
        tests = _texts(path)
    if not {"metric", "baseline"} <= set(tests):
        raise UserError(f"{path}: not the table of tests; write it with 'holoeval report'")
    pairs = set(zip(tests["metric"], tests["baseline"], strict=True))
    if not pairs:
        return next(score for score in scores if score.metric in METRICS), None
    metric, baseline = min(pairs)
    tested = next((score for score in scores if score.column == metric), None)
    if len(pairs) > 1 or tested is None or baseline not in set(frame["label"]):
        raise UserError(f"{path}: its metric or baseline is not in {RECORDS}; write both with 'holoeval report'")
    return tested, str(baseline)


def _layout(folder: Path, frame: pd.DataFrame, headline: str, baseline: str | None) -> Layout:
    """What the tables need of the study, from its records alone."""
    shown = frame[frame["category"] != FLOOR]
    by_category = {name: frozenset(shown.loc[shown["category"] == name, "label"]) for name in CATEGORIES}
    learned = frozenset(shown.loc[shown["learned_sha256"] != "", "label"]) if "learned_sha256" in shown else frozenset()
    return Layout(
        title=folder.resolve().name,
        pairs=tuple(dict.fromkeys(zip(shown["label"], shown["condition"], strict=True))),
        targets=tuple(dict.fromkeys(frame["target"])),
        headline=headline,
        baseline=baseline,
        privileged=by_category[ORACLE],
        trained=by_category[CALIBRATED] | learned,
        blind=by_category[OPEN_LOOP],
        camera=by_category[ONLINE],
        identities=_identities(folder / TABLE),
        measure=str(frame["measure"].iloc[0]),
        clusters=clusters_in(frame),
        study=folder.resolve().name,
    )


def _identities(path: Path) -> frozenset[str]:
    """Labels whose network is the identity, from table.csv, which folders of others may lack."""
    if not path.exists():
        return frozenset()
    _check_file(path)
    table = _texts(path)
    if not {"label", "parameters"} <= set(table):
        return frozenset()
    return frozenset(str(row["label"]) for _, row in table.iterrows() if _network(row["parameters"]) == "identity")


def _network(parameters: str) -> str:
    try:
        return network_of(json.loads(parameters or "{}"))
    except ValueError:
        return ""
