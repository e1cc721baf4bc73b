"""A folder on its way into the site: its records and provenance, read and checked.

Folders come from anybody. Nothing of them is run, no config is opened, and what does not pass is a ``UserError`` in one
line. What lies below the folder of own reports is own. Any other folder says whose it is by the key ``by`` of its
provenance, and has to say the harness that its numbers come from.
"""

from __future__ import annotations

import io
import itertools
import json
import re
import sys
import unicodedata
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import pandas as pd

from ...core.errors import UserError
from ...study.running import provenance
from ..compare.paired import records_of
from ..data.layout import CALIBRATED, CATEGORIES, FLOOR, ONLINE, OPEN_LOOP, ORACLE, Layout, network_of
from ..data.results import Results
from ..data.scores import METRICS, Score, parse
from ..data.tables import DONE, GUARDED, clusters_in, records_text, score_columns
from ..data.text import FILES
from ..files.dictionary import column

RECORDS: Final = "records.csv"
LONGEST = 300  # characters of a name
MOST_ROWS, MOST_LABELS, MOST_COUNTED = 20_000, 500, 1e9
KINDS = ("simulated", "real", "learned")
STATES = (DONE, "failed", "skipped", "unavailable", "missing")
MEASURES = ("picture", "focus", "views", "prediction", "error_budget", FILES)
EXPOSURES = ("equal", "matched", "")
LOUDEST = 200.0  # dB, of any score that makes sense
FINITE = sys.float_info.max  # the same of other scores
NAMES = ("display", "condition", "method", "label", "target", "cluster")
CAPTURES = ("captures", "training_captures")
COUNTS = (*CAPTURES, "solving_s", "training_s")

_SIDE = re.compile(r"[1-9][0-9]{0,4}")
_SHA256 = re.compile(r"[0-9a-f]{64}")


def folded(name: str) -> str:
    """A name without what is easily overlooked: case, space, and forms of one character."""
    return " ".join(unicodedata.normalize("NFKC", name).casefold().split())


def names_wrong(raw: pd.DataFrame) -> Iterator[str]:
    """Names that a reader cannot see or tell apart, or too many. raw: every cell of records as text."""
    labels = raw["label"].nunique() if "label" in raw else 0
    for number, most, what in ((len(raw), MOST_ROWS, "rows"), (labels, MOST_LABELS, "labels")):
        if number > most:
            yield f"{number} {what}; expected at most {most} in a study"
    for name in (each for each in NAMES if each in raw):
        seen: dict[str, str] = {}
        for text in sorted(raw[name].unique()):
            if len(text) > LONGEST:
                yield f"{name}: a name of {len(text)} characters; expected at most {LONGEST}"
            if not text.isprintable():
                yield f"{name} {text!r}: characters that cannot be seen; take them out"
            if (other := seen.setdefault(folded(text), text)) != text or text != text.strip():
                yield f"{name} {text!r}: differs by case or space alone from {other.strip()!r}; use one"


def facts_wrong(known: Mapping[str, Any], frame: pd.DataFrame, strict: bool) -> Iterator[str]:
    """Facts that a provenance lacks, each only where those before are there. strict: of a folder of others."""
    measured_files, remedy = "files" in known, "copy the provenance.json that 'holoeval run' wrote"
    needed = ["package", *(["harness"] if strict and not measured_files else [])]
    lacking = [key for key in needed if not isinstance(known.get(key), str) or not known[key]]
    profiles = known.get("profiles", {})
    if not isinstance(profiles, dict) or not (profiles or measured_files):
        lacking.append("profiles")
    if lacking:
        yield f"lacks {', '.join(lacking)}; {remedy}"
    for name, profile in profiles.items():
        digest = profile.get("sha256") if isinstance(profile, dict) else None
        if not isinstance(digest, str) or not _SHA256.fullmatch(digest):
            yield f"profile {name!r} has no digest; expected its version and 64 digits of sha256"
    kinds = known.get("displays", {})
    if not isinstance(kinds, dict) or not all(kind in KINDS for kind in kinds.values()):
        yield f'"displays" says what each display is; expected one of {", ".join(KINDS)} for each'
    unknown = sorted(set(frame["display"]) - {*profiles})
    if unknown and not (frame["measure"] == FILES).all():
        yield f"no digest of the display {unknown[0]!r} of {RECORDS}; {remedy} with it"


def columns_wrong(frame: pd.DataFrame) -> Iterator[str]:
    """A column that is unknown, or none of a score."""
    if unknown := [name for name in frame if column(RECORDS, str(name)) is None]:
        yield f"unknown column {unknown[0]!r}; expected those of columns.md (docs/results/data.md); take it out"
    if not any(parse(name).metric in METRICS for name in score_columns(frame)):
        yield "no column of a score; expected one such as psnr_linear_db"


def cells_wrong(raw: pd.DataFrame, frame: pd.DataFrame) -> Iterator[str]:
    """A word that is not known, a number that cannot be, or two cells that contradict each other."""
    for name, allowed in (
        ("state", STATES),
        ("exposure", EXPOSURES),
        ("measure", MEASURES),
        ("category", (*CATEGORIES, FLOOR)),
    ):
        if wrong := sorted(set(frame[name]) - set(allowed)):
            yield f"{name} {wrong[0]!r}; expected one of {', '.join(word or 'nothing' for word in allowed)}"
    if len(measures := sorted(set(frame["measure"]))) > 1:
        yield f"measures {' and '.join(measures)}; expected one study a folder"
    scores = score_columns(frame)
    for name in [*scores, *(name for name in COUNTS if name in frame)]:
        low, high = _bounds(name)
        rows = frame[~frame[name].between(low, high) & (raw[name] != "")]  # what is text and no number is wrong, too
        if len(rows):
            right = f"from {low:g} to {high:g}" if high < FINITE else "that is finite"
            yield f"{_named(rows)} has {name} {rows[name].iloc[0]:g}; expected a number {right}"
    for side in ("panel_height_px", "panel_width_px"):
        if wrong := sorted(text for text in set(raw[side]) if text and not _SIDE.fullmatch(text)):
            yield f"{side} {wrong[0]!r}; expected a number of pixels from 1 to 99999"
    spent = frame[[name for name in CAPTURES if name in frame]].gt(0).any(axis=1)
    done, scored = frame["state"] == DONE, frame[scores].notna().any(axis=1)
    for is_wrong, what in (
        (spent & (frame["category"] == OPEN_LOOP), f"{OPEN_LOOP} and has captures; expected none, or another category"),
        (done & ~scored, "done and has no score; expected a score of done cells alone"),
        (~done & scored, "not done and has a score; expected a score of done cells alone"),
    ):
        if is_wrong.any():
            yield f"{_named(frame[is_wrong])} is {what}"


def _bounds(name: str) -> tuple[float, float]:
    """Least and most that a score or a count can be."""
    metric = METRICS.get(parse(name).metric)
    if name in COUNTS:
        return 0.0, MOST_COUNTED
    if metric is None:
        return -FINITE, FINITE
    bound = LOUDEST if metric.unit == "dB" else 100.0
    if metric.direction == "higher":
        return -bound, min(metric.best, bound) + 1e-5
    return max(metric.best, -bound) - 1e-5, bound


def _named(rows: pd.DataFrame) -> str:
    """The first of some rows, as a message names it."""
    return ", ".join(str(rows.iloc[0][name])[:60] for name in ("label", "condition", "target"))


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
    if not folder.resolve().name.isprintable():
        raise UserError(f"{str(folder)!r}: its name has characters that cannot be seen; rename it")
    for problem in names_wrong(raw):
        raise UserError(f"{folder / RECORDS}: {problem}")
    frame = records_of(folder, records_text(folder / RECORDS))
    of_records = itertools.chain(columns_wrong(frame), cells_wrong(raw, frame))
    for path, problems in ((RECORDS, of_records), (provenance.FILE, facts_wrong(known, frame, strict=bool(by)))):
        for problem in problems:
            raise UserError(f"{folder / path}: {problem}")
    displays = frame.loc[(frame["condition"] == frame["display"]) & (frame["category"] != FLOOR), "condition"]
    nominal = frame[(frame["category"] == FLOOR) | frame["condition"].isin(displays)].reset_index(drop=True)
    if displays.empty:
        raise UserError(
            f"{folder / RECORDS}: no row of an unchanged display; expected rows whose condition is a display"
        )
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
