"""What a folder has to hold: names that can be told apart, known words, possible numbers. A fault is one line."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd

from ...core.errors import UserError
from ...study.running import provenance
from ..data.categories import CATEGORIES, FLOOR, OPEN_LOOP
from ..data.scores import METRICS, parse
from ..data.tables import DONE, score_columns
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
NAMES = ("display", "condition", "method", "label", "target", "cluster")
CAPTURES = ("captures", "training_captures")
COUNTS = (*CAPTURES, "solving_s", "training_s")

_SIDE = re.compile(r"[1-9][0-9]{0,4}")
_SHA256 = re.compile(r"[0-9a-f]{64}")


def folded(name: str) -> str:
    """A name without what is easily overlooked: case, space, and forms of one character."""
    return " ".join(unicodedata.normalize("NFKC", name).casefold().split())


def check_names(folder: Path, raw: pd.DataFrame) -> None:
    """UserError: names that a reader cannot see or tell apart, or too many."""
    if not folder.resolve().name.isprintable():
        raise UserError(f"{str(folder)!r}: its name has characters that cannot be seen; rename it")
    for column_name in (name for name in NAMES if name in raw):
        seen: dict[str, str] = {}
        for name in sorted(raw[column_name].unique()):
            where = f"{folder / RECORDS}: {column_name}"
            if len(name) > LONGEST:
                raise UserError(f"{where}: a name of {len(name)} characters; expected at most {LONGEST}")
            if not name.isprintable():
                raise UserError(f"{where} {name!r}: characters that cannot be seen; take them out")
            if (other := seen.setdefault(folded(name), name)) != name or name != name.strip():
                raise UserError(f"{where} {name!r}: differs by case or space alone from {other.strip()!r}; use one")
    count = raw["label"].nunique() if "label" in raw else 0
    for number, most, what in ((len(raw), MOST_ROWS, "rows"), (count, MOST_LABELS, "labels")):
        if number > most:
            raise UserError(f"{folder / RECORDS}: {number} {what}; expected at most {most} in a study")


def check_provenance(folder: Path, known: Mapping[str, Any], strict: bool) -> None:
    """UserError: facts are lacking. strict: of a folder of others."""
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
            raise UserError(f"{path}: profile {name!r} has no digest; expected its version and 64 digits of sha256")
    kinds = known.get("displays", {})
    if not isinstance(kinds, dict) or not all(kind in KINDS for kind in kinds.values()):
        raise UserError(f'{path}: "displays" says what each display is; expected one of {", ".join(KINDS)} for each')


def check_columns(folder: Path, frame: pd.DataFrame) -> None:
    """UserError: a column is unknown, or there is none of a score."""
    path = folder / RECORDS
    unknown = [name for name in frame if column(RECORDS, str(name)) is None]
    if unknown:
        raise UserError(
            f"{path}: unknown column {unknown[0]!r}; expected those of columns.md (docs/results/data.md); take it out"
        )
    if not any(parse(name).metric in METRICS for name in score_columns(frame)):
        raise UserError(f"{path}: no column of a score; expected one such as psnr_linear_db")


def check_rows(folder: Path, raw: pd.DataFrame, frame: pd.DataFrame) -> None:
    """UserError: a word that is not known, a number that cannot be, or two cells that contradict each other."""
    path = folder / RECORDS
    for name, allowed in (
        ("state", STATES),
        ("exposure", EXPOSURES),
        ("measure", MEASURES),
        ("category", (*CATEGORIES, FLOOR)),
    ):
        wrong = sorted(set(frame[name]) - set(allowed))
        if wrong:
            named = ", ".join(word or "nothing" for word in allowed)
            raise UserError(f"{path}: {name} {wrong[0]!r}; expected one of {named}")
    if len(measures := sorted(set(frame["measure"]))) > 1:
        raise UserError(f"{path}: measures {' and '.join(measures)}; expected one study a folder")
    for name in [*score_columns(frame), *(name for name in COUNTS if name in frame)]:
        _check_numbers(path, raw, frame, name)
    for side in ("panel_height_px", "panel_width_px"):
        wrong = sorted(text for text in set(raw[side]) if text and not _SIDE.fullmatch(text))
        if wrong:
            raise UserError(f"{path}: {side} {wrong[0]!r}; expected a number of pixels from 1 to 99999")
    spent = frame[[name for name in CAPTURES if name in frame]].gt(0).any(axis=1)
    done, scored = frame["state"] == DONE, frame[score_columns(frame)].notna().any(axis=1)
    for rows, what in (
        (spent & (frame["category"] == OPEN_LOOP), f"{OPEN_LOOP} and has captures; expected none, or another category"),
        (done & ~scored, "done and has no score; expected a score of done cells alone"),
        (~done & scored, "not done and has a score; expected a score of done cells alone"),
    ):
        if rows.any():
            raise UserError(f"{path}: {_named(frame[rows])} is {what}")


def _check_numbers(path: Path, raw: pd.DataFrame, frame: pd.DataFrame, name: str) -> None:
    """UserError: a number that is not finite, or that no such score or count can be."""
    values, metric = frame[name].to_numpy(dtype=np.float64), METRICS.get(parse(name).metric)
    low, high = -np.inf, np.inf
    if name in COUNTS:
        low, high = 0.0, MOST_COUNTED
    elif metric is not None:
        bound = LOUDEST if metric.unit == "dB" else 100.0
        best = min(metric.best, bound) if metric.direction == "higher" else max(metric.best, -bound)
        low, high = (-bound, best + 1e-5) if metric.direction == "higher" else (best - 1e-5, bound)
    wrong = np.isinf(values) | (values < low) | (values > high) | (np.isnan(values) & (raw[name] != "").to_numpy())
    if wrong.any():
        row = frame[wrong]
        limits = f"from {low:g} to {high:g}" if np.isfinite(high) else "finite"
        raise UserError(f"{path}: {_named(row)} has {name} {row[name].iloc[0]:g}; expected a number {limits}")


def _named(rows: pd.DataFrame) -> str:
    """The first of some rows, as a message names it."""
    return ", ".join(str(rows.iloc[0][name])[:60] for name in ("label", "condition", "target"))


def check_displays(folder: Path, known: Mapping[str, Any], frame: pd.DataFrame) -> None:
    """UserError: a display of the records is not in the provenance."""
    unknown = sorted(set(frame["display"]) - {*known.get("profiles", {})})
    if unknown and not (frame["measure"] == FILES).all():
        raise UserError(
            f"{folder / provenance.FILE}: no digest of the display {unknown[0]!r} of {RECORDS}; copy the "
            "provenance.json that 'holoeval run' wrote with it"
        )
