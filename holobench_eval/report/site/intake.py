"""A folder on its way into the site: its records and provenance, read and checked.

Folders come from anybody. Nothing of them is run, no config is opened, and what does not pass is a ``UserError`` in one
line. A folder of others says whose it is by the key ``by`` of its provenance, and has to say more of where its numbers
come from than a report of an earlier version did.
"""

from __future__ import annotations

import io
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd

from ...core.errors import UserError
from ...study import provenance
from ...study.plan import REFERENCE
from ..compare.runs import read_run
from ..data.categories import CALIBRATED, CATEGORIES, FLOOR, ONLINE, ORACLE
from ..data.columns import column, file_name
from ..data.layout import Layout
from ..data.results import Results
from ..data.scores import METRICS, parse
from ..data.tables import CATEGORY_COLUMN, DONE, clusters_in, score_columns
from ..data.text import FILES

RECORDS: Final = "records.csv"
TESTS: Final = "tests.csv"
MOST_BYTES, MOST_FACTS = 64_000_000, 2_000_000  # of a file of numbers, and of a provenance
LONGEST = 300  # characters of a name
BY = "by"  # the key of a provenance that says whose results they are
KINDS = ("simulated", "real", "learned")
STATES = (DONE, "failed", "skipped", "unavailable", "missing")
MEASURES = ("picture", "focus", "prediction", "error_budget", FILES)
EXPOSURES = ("equal", "matched", "")
LOUDEST = 200.0  # dB, of any score that makes sense
# Columns of records.csv that a folder of others has, beside those that ``tables.read_records`` asks for.
TEXTS = ("measure", "display", "condition", "method", "label", "parameters", "target")
OF_OTHERS = ("measure", "display", "category", "panel_height_px", "panel_width_px")
COUNTS = ("captures", "seconds", "training_captures", "training_seconds")

_SHA256 = re.compile(r"[0-9a-f]{64}")
_FORMULA = re.compile(r"^'('*\s*[=+\-@＝＋－＠])")


@dataclass(frozen=True)
class Source:
    """A folder that was taken in.

    name: of the study; by: whose results they are (empty: of whoever makes the site); results: its numbers without
    changed displays; measure: what was scored; panels: rows x columns of each display (empty: not recorded); known: its
    provenance; parameters: of every label, as JSON; changed: conditions that are a change of a display.
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
    def harness(self) -> str:
        """The version of everything between a phase and its score; empty where it is not recorded."""
        return str(self.known.get("harness", ""))

    @property
    def processor(self) -> str:
        """What the seconds were taken on."""
        return str(self.known.get("gpu") or self.known.get("cpu") or "processor not recorded")

    @cached_property
    def earlier(self) -> bool:
        """Whether its records have the columns of an earlier version of this package."""
        with (self.folder / RECORDS).open(encoding="utf-8") as file:
            return "label" not in file.readline().rstrip("\n").split(",")


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
        if not inside:
            raise UserError(
                f"{folder}: no report in it; expected {RECORDS} and {provenance.FILE}, here or a level below"
            )
        for path in inside:
            found.setdefault(path.resolve(), path)
    return list(found.values()), without


def _is_report(folder: Path) -> bool:
    return any((folder / name).exists() or (folder / name).is_symlink() for name in (RECORDS, provenance.FILE))


def read(folder: Path) -> Source:
    """Take in a folder. UserError: what is wrong with it, and what would be right."""
    _check_file(folder / RECORDS)
    _check_file(folder / provenance.FILE, MOST_FACTS)
    known, raw = _known(folder), _raw(folder, _text(folder / RECORDS))
    frame = read_run(folder).records
    by = _whose(folder, known)
    _check_provenance(folder, known, strict=bool(by))
    _check_columns(folder, raw, frame, strict=bool(by))
    _check_rows(folder, raw, frame)
    measure = _measure(folder, raw, frame)
    nominal = frame[frame["condition"].isin([REFERENCE, *_nominal(frame)])].reset_index(drop=True)
    if set(nominal["condition"]) <= {REFERENCE}:
        raise UserError(
            f"{folder / RECORDS}: no row of an unchanged display; expected rows whose condition is a display"
        )
    _check_displays(folder, known, nominal, measure)
    headline, baseline = _tested(folder, nominal)
    # A site shows the headline; error budgets are made of further scores.
    spare = [key for key in score_columns(nominal) if key != headline and measure != "error_budget"]
    results = Results(nominal.drop(columns=spare), _layout(folder, raw, nominal, measure, headline, baseline))
    changed = frame["condition"].nunique() - nominal["condition"].nunique()
    return Source(folder, folder.resolve().name, by, results, measure, _panels(raw), known, _parameters(raw), changed)


def _check_file(path: Path, most: int = MOST_BYTES) -> None:
    if path.is_symlink() or not path.is_file():
        what = "a link" if path.is_symlink() else "missing"
        raise UserError(f"{path}: {what}; a folder of results holds {RECORDS} and {provenance.FILE} as files")
    if path.stat().st_size > most:
        raise UserError(f"{path}: more than {most // 10**6} MB; expected that of one study")


def _known(folder: Path) -> dict[str, Any]:
    try:
        known = provenance.read(folder)
        json.dumps(known, ensure_ascii=False).encode()
    except (RecursionError, UnicodeEncodeError):
        wrong = "nested too deeply, or not Unicode"
        raise UserError(f"{folder / provenance.FILE}: {wrong}; expected that of 'holoeval run'") from None
    return known


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise UserError(f"{path}: not UTF-8 ({error}); write it with 'holoeval report'") from None


def _raw(folder: Path, text: str) -> pd.DataFrame:
    """Every cell of records.csv as text, under the names of the file, without the apostrophes before formulas."""
    try:
        frame = pd.read_csv(io.StringIO(text), dtype=str, keep_default_na=False)
    except ValueError as error:
        raise UserError(f"{folder / RECORDS}: not a table ({error}); write it with 'holoeval report'") from None
    if frame.empty:
        raise UserError(f"{folder / RECORDS}: no rows; expected a row a cell")
    texts = [name for name in TEXTS if name in frame]
    frame[texts] = frame[texts].replace(_FORMULA.pattern, r"\1", regex=True)
    return frame


def _whose(folder: Path, known: Mapping[str, Any]) -> str:
    """Whose results they are; a folder without report.md did not come from ``holoeval run`` here."""
    by = known.get(BY, "")
    if not isinstance(by, str) or len(by) > LONGEST or (BY in known and not by.strip()):
        raise UserError(f'{folder / provenance.FILE}: "{BY}" is not a name; expected a text, such as "{BY}": "Our lab"')
    if not by and not (folder / "report.md").is_file():
        raise UserError(
            f'{folder / provenance.FILE}: lacks "{BY}", whose results these are; add it, such as "{BY}": "Our lab" '
            "(a report of your own has report.md)"
        )
    return " ".join(by.split())


def _check_provenance(folder: Path, known: Mapping[str, Any], strict: bool) -> None:
    path, measured_files = folder / provenance.FILE, "files" in known
    needed = ["package", *(["harness"] if strict and not measured_files else [])]
    lacking = [key for key in needed if not isinstance(known.get(key), str) or not known[key]]
    profiles = known.get("profiles", {})
    if not isinstance(profiles, dict) or not (profiles or measured_files):
        lacking.append("profiles")
    if lacking:
        raise UserError(f"{path}: lacks {', '.join(lacking)}; copy the provenance.json that 'holoeval run' wrote")
    for name, profile in profiles.items():
        digest = profile.get("sha256") if isinstance(profile, dict) else None
        if not isinstance(digest, str) or not _SHA256.fullmatch(digest):
            raise UserError(f"{path}: profile '{name}' has no digest; expected its version and 64 digits of sha256")
    kinds = known.get("displays", {})
    if not isinstance(kinds, dict) or not all(kind in KINDS for kind in kinds.values()):
        raise UserError(f'{path}: "displays" says what each display is; expected one of {", ".join(KINDS)} for each')


def _check_columns(folder: Path, raw: pd.DataFrame, frame: pd.DataFrame, strict: bool) -> None:
    path = folder / RECORDS
    lacking = [name for name in OF_OTHERS if name not in raw]
    if strict and lacking:
        raise UserError(f"{path}: lacks the columns {', '.join(lacking)}; write it with 'holoeval report'")
    unknown = [name for name in raw if column(RECORDS, str(name)) is None] if "label" in raw else []
    if unknown:
        raise UserError(
            f"{path}: unknown column {unknown[0]!r}; expected those of columns.md (docs/results/data.md); take it out"
        )
    if not any(parse(key).metric in METRICS for key in score_columns(frame)):
        raise UserError(f"{path}: no column of a score; expected one such as psnr_linear_db")


def _check_rows(folder: Path, raw: pd.DataFrame, frame: pd.DataFrame) -> None:
    path = folder / RECORDS
    names = [name for name in ("label", "method", "target", "condition", "display") if name in raw]
    longest = max(int(raw[name].str.len().max()) for name in names)
    if longest > LONGEST:
        raise UserError(f"{path}: a name of {longest} characters; expected at most {LONGEST}")
    category = "category" if "category" in raw else CATEGORY_COLUMN
    for name, allowed in (
        ("state", STATES),
        ("exposure", EXPOSURES),
        ("measure", MEASURES),
        (category, (*CATEGORIES, FLOOR, "")),
    ):
        wrong = sorted(set(raw[name]) - set(allowed)) if name in raw else []
        if wrong and (name != "exposure" or "label" in raw):
            named = ", ".join(word or "nothing" for word in allowed)
            raise UserError(f"{path}: {name} {wrong[0]!r}; expected one of {named}")
    for key in [*score_columns(frame), *(name for name in COUNTS if name in frame)]:
        _check_numbers(path, raw, frame, key)
    done, scores = frame["state"] == DONE, frame[score_columns(frame)].notna()
    for rows, what in (
        (frame[done & ~scores.any(axis=1)], "is done and has no score"),
        (frame[~done & scores.any(axis=1)], "is not done and has a score"),
    ):
        if len(rows):
            raise UserError(f"{path}: {_named(rows)} {what}; expected a score of done cells alone")


def _check_numbers(path: Path, raw: pd.DataFrame, frame: pd.DataFrame, key: str) -> None:
    """UserError: a number that is not finite, or that no such score or count can be."""
    values, score = frame[key].to_numpy(dtype=np.float64), parse(key)
    metric = METRICS.get(score.metric)
    low, high = -np.inf, np.inf
    if key in COUNTS:
        low = 0.0
    elif metric is not None:
        bound = LOUDEST if metric.unit == "dB" else 100.0
        best = min(metric.best, bound) if metric.direction == "higher" else max(metric.best, -bound)
        low, high = (-bound, best + 1e-5) if metric.direction == "higher" else (best - 1e-5, bound)
    written = raw[file_name(key)] if file_name(key) in raw else raw[key]
    wrong = np.isinf(values) | (values < low) | (values > high) | (np.isnan(values) & (written != "").to_numpy())
    if wrong.any():
        row = frame[wrong]
        limits = f"from {low:g} to {high:g}" if np.isfinite(high) else f"of at least {low:g}" if low == 0 else "finite"
        raise UserError(f"{path}: {_named(row)} has {file_name(key)} {row[key].iloc[0]:g}; expected a number {limits}")


def _named(rows: pd.DataFrame) -> str:
    """The first of some rows, as a message names it."""
    return ", ".join(str(rows.iloc[0][name])[:60] for name in ("method", "condition", "target"))


def _measure(folder: Path, raw: pd.DataFrame, frame: pd.DataFrame) -> str:
    """What was scored. Records of earlier versions do not say it: planes have scores in focus, pictures efficiency."""
    if "measure" in raw:
        found = sorted(set(raw["measure"]))
        if len(found) > 1:
            raise UserError(f"{folder / RECORDS}: measures {' and '.join(found)}; expected one study a folder")
        return str(found[0])
    scores = [parse(key) for key in score_columns(frame)]
    if any(score.in_focus for score in scores):
        return "focus"
    return "picture" if any(score.key == "efficiency" for score in scores) else "prediction"


def _nominal(frame: pd.DataFrame) -> list[str]:
    """The conditions that are displays as they were calibrated. Pictures from files have no profile."""
    own = frame[(frame["condition"] == frame["profile"]) | (frame["profile"] == "")]
    return [str(name) for name in own["condition"].unique() if name != REFERENCE]


def _check_displays(folder: Path, known: Mapping[str, Any], frame: pd.DataFrame, measure: str) -> None:
    unknown = sorted(set(frame["profile"]) - {"", *known.get("profiles", {})})
    if unknown and measure != FILES:
        raise UserError(
            f"{folder / provenance.FILE}: no digest of the display '{unknown[0]}' of {RECORDS}; copy the "
            "provenance.json that 'holoeval run' wrote with it"
        )


def _tested(folder: Path, frame: pd.DataFrame) -> tuple[str, str | None]:
    """Score and baseline of the study's paired tests; without tests.csv the first score, and no baseline."""
    keys, path = score_columns(frame), folder / TESTS
    first = next(key for key in keys if parse(key).metric in METRICS)
    if not path.exists():
        return first, None
    _check_file(path)
    try:
        tests = pd.read_csv(io.StringIO(_text(path)), dtype=str, keep_default_na=False)
        tests = tests.replace(_FORMULA.pattern, r"\1", regex=True)
        pairs = {(str(a), str(b)) for a, b in zip(tests["metric"], tests["baseline"], strict=True)}
    except (ValueError, KeyError) as error:
        raise UserError(f"{path}: not the table of tests ({error}); write it with 'holoeval report'") from None
    if not pairs:
        return first, None
    metric, baseline = sorted(pairs)[0]
    key = next((key for key in keys if file_name(key) == metric), None)
    if len(pairs) > 1 or key is None or baseline not in set(frame["method"]):
        raise UserError(f"{path}: its metric or baseline is not in {RECORDS}; write both with 'holoeval report'")
    return key, baseline


def _layout(
    folder: Path, raw: pd.DataFrame, frame: pd.DataFrame, measure: str, headline: str, baseline: str | None
) -> Layout:
    """What the tables need of the study, from its records alone."""
    shown = frame[frame["condition"] != REFERENCE]
    category = shown[CATEGORY_COLUMN] if CATEGORY_COLUMN in shown else pd.Series("", index=shown.index)
    by_category = {name: frozenset(shown.loc[category == name, "method"]) for name in CATEGORIES}
    identities = [label for label, text in _parameters(raw).items() if _network(text) == "identity"]
    return Layout(
        title=folder.resolve().name,
        pairs=tuple(dict.fromkeys(zip(shown["method"], shown["condition"], strict=True))),
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
        network = json.loads(parameters or "{}").get("network")
    except (ValueError, AttributeError):
        return ""
    return str(network.get("name", "")) if isinstance(network, dict) else ""


def _panels(raw: pd.DataFrame) -> dict[str, str]:
    if not {"panel_height_px", "panel_width_px", "display"} <= set(raw):
        return {}
    rows = raw.drop_duplicates("display")
    sides = zip(rows["display"], rows["panel_height_px"], rows["panel_width_px"], strict=True)
    return {str(name): f"{height} x {width}" for name, height, width in sides if height and width}


def _parameters(raw: pd.DataFrame) -> dict[str, str]:
    if not {"label", "parameters"} <= set(raw):
        return {}
    return {str(label): str(text) for label, text in zip(raw["label"], raw["parameters"], strict=True)}
