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
from ...study import provenance
from ..compare.runs import records_of
from ..data.categories import CALIBRATED, CATEGORIES, FLOOR, ONLINE, ORACLE
from ..data.layout import Layout, network_of
from ..data.results import Results
from ..data.scores import METRICS, Score, parse
from ..data.tables import GUARDED, clusters_in, records_text, score_columns
from . import checks
from .checks import LONGEST, NAMES, RECORDS, folded

TABLE: Final = "table.csv"
TESTS: Final = "tests.csv"
BY = "by"  # the key of a provenance that says whose results they are
OWN = "own"  # how the site calls results of whoever makes it
TEXTS = ("measure", "parameters", *NAMES)


@dataclass(frozen=True)
class Source:
    """A folder that was taken in.

    name: of the study; by: whose results they are (empty: of whoever makes the site); results: its numbers without
    changed displays; measure: what was scored; panels: rows x columns of each display (empty: not recorded);
    known: its provenance; parameters: of every label, as JSON; changed: conditions that are a change of a display.
    """

    folder: Path
    name: str
    by: str
    results: Results
    measure: str
    panels: Mapping[str, str]
    known: Mapping[str, Any]
    parameters: Mapping[str, str]
    changed: int

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
        inside = [folder]
        if not _is_report(folder):
            inside = sorted(path for path in folder.iterdir() if path.is_dir() and not path.name.startswith("."))
            without += [path for path in inside if not _is_report(path)]
            inside = [path for path in inside if _is_report(path)]
            if links := [path for path in inside if path.is_symlink()]:
                raise UserError(f"{links[0]}: a link; expected a folder, or name the report itself")
        if not inside:
            raise UserError(
                f"{folder}: no report in it; expected {RECORDS} and {provenance.FILE}, here or a level below"
            )
        for path in inside:
            found.setdefault(path.resolve(), path)
    return list(found.values()), without


def _is_report(folder: Path) -> bool:
    return any((folder / name).exists() or (folder / name).is_symlink() for name in (RECORDS, provenance.FILE))


def read(folder: Path, own: Path) -> Source:
    """Take in a folder. own: below it are own reports. UserError: what is wrong, and what would be right."""
    _check_file(folder / RECORDS)
    _check_file(folder / provenance.FILE)
    known, text = _known(folder), records_text(folder / RECORDS)
    raw = _raw(folder / RECORDS, text)
    by = _whose(folder, known, own)
    checks.check_names(folder, raw)
    frame = records_of(folder, text)
    checks.check_provenance(folder, known, strict=bool(by))
    checks.check_columns(folder, frame)
    checks.check_rows(folder, raw, frame)
    measure = _measure(folder, frame)
    nominal = frame[(frame["category"] == FLOOR) | frame["condition"].isin(_nominal(frame))].reset_index(drop=True)
    if (nominal["category"] == FLOOR).all():
        raise UserError(
            f"{folder / RECORDS}: no row of an unchanged display; expected rows whose condition is a display"
        )
    checks.check_displays(folder, known, nominal, measure)
    headline, baseline = _tested(folder, nominal)
    parameters = _parameters(folder)
    results = Results(nominal, _layout(folder, parameters, nominal, measure, headline.key, baseline))
    if measure != "error_budget":  # which is made of further scores than those that a site shows
        kept = {score.column for score in (headline, *results.beside)}
        results = replace(results, frame=nominal.drop(columns=[*{*score_columns(nominal)} - kept]))
    changed = frame["condition"].nunique() - nominal["condition"].nunique()
    return Source(folder, folder.resolve().name, by, results, measure, _panels(frame), known, parameters, changed)


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


def _raw(path: Path, text: str) -> pd.DataFrame:
    """Every cell of a file of numbers as text, under the names of the file, without the apostrophes before formulas."""
    try:
        frame = pd.read_csv(io.StringIO(text), dtype=str, keep_default_na=False)
    except ValueError as error:
        reason = " ".join(str(error).split())
        raise UserError(f"{path}: not a table ({reason}); write it with 'holoeval report'") from None
    if frame.empty:
        raise UserError(f"{path}: no rows; write it with 'holoeval report'")
    texts = [name for name in TEXTS if name in frame]
    frame[texts] = frame[texts].replace(GUARDED, r"\1", regex=True)
    return frame


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


def _measure(folder: Path, frame: pd.DataFrame) -> str:
    """What was scored."""
    found = sorted(set(frame["measure"]))
    if len(found) > 1:
        raise UserError(f"{folder / RECORDS}: measures {' and '.join(found)}; expected one study a folder")
    return str(found[0])


def _nominal(frame: pd.DataFrame) -> list[str]:
    """The conditions that are displays as they were calibrated."""
    own = frame[(frame["condition"] == frame["display"]) & (frame["category"] != FLOOR)]
    return [str(name) for name in own["condition"].unique()]


def _tested(folder: Path, frame: pd.DataFrame) -> tuple[Score, str | None]:
    """Score and baseline of the study's paired tests; without tests.csv the first score, and no baseline."""
    scores, path = [parse(name) for name in score_columns(frame)], folder / TESTS
    first = next(score for score in scores if score.metric in METRICS)
    if not path.exists():
        return first, None
    _check_file(path)
    try:
        tests = pd.read_csv(io.StringIO(records_text(path)), dtype=str, keep_default_na=False)
        tests = tests.replace(GUARDED, r"\1", regex=True)
        pairs = {(str(a), str(b)) for a, b in zip(tests["metric"], tests["baseline"], strict=True)}
    except (ValueError, KeyError) as error:
        raise UserError(f"{path}: not the table of tests ({error}); write it with 'holoeval report'") from None
    if not pairs:
        return first, None
    metric, baseline = sorted(pairs)[0]
    tested = next((score for score in scores if score.column == metric), None)
    if len(pairs) > 1 or tested is None or baseline not in set(frame["label"]):
        raise UserError(f"{path}: its metric or baseline is not in {RECORDS}; write both with 'holoeval report'")
    return tested, baseline


def _layout(
    folder: Path, parameters: Mapping[str, str], frame: pd.DataFrame, measure: str, headline: str, baseline: str | None
) -> Layout:
    """What the tables need of the study, from its records alone."""
    shown = frame[frame["category"] != FLOOR]
    by_category = {name: frozenset(shown.loc[shown["category"] == name, "label"]) for name in CATEGORIES}
    identities = [label for label, text in parameters.items() if _network(text) == "identity"]
    return Layout(
        title=folder.resolve().name,
        pairs=tuple(dict.fromkeys(zip(shown["label"], shown["condition"], strict=True))),
        targets=tuple(dict.fromkeys(frame["target"])),
        headline=headline,
        baseline=baseline,
        privileged=by_category[ORACLE],
        trained=by_category[CALIBRATED],
        camera=by_category[ONLINE],
        identities=frozenset(identities),
        measure=measure,
        clusters=clusters_in(frame),
        study=folder.resolve().name,
    )


def _network(parameters: str) -> str:
    try:
        return network_of(json.loads(parameters or "{}"))
    except ValueError:
        return ""


def _panels(frame: pd.DataFrame) -> dict[str, str]:
    rows = frame.drop_duplicates("display").dropna(subset=["panel_height_px", "panel_width_px"])
    sides = zip(rows["display"], rows["panel_height_px"], rows["panel_width_px"], strict=True)
    return {str(name): f"{height:.0f} x {width:.0f}" for name, height, width in sides}


def _parameters(folder: Path) -> dict[str, str]:
    """Parameters of every label as JSON, from table.csv, which folders of others may lack."""
    path = folder / TABLE
    if not path.exists():
        return {}
    _check_file(path)
    table = _raw(path, records_text(path))
    if not {"label", "parameters"} <= set(table):
        return {}
    return {str(label): str(text) for label, text in zip(table["label"], table["parameters"], strict=True)}
