"""What stays of a training beside a report: its log and its provenance, small enough to be committed.

The learned tensors are in the folder of artifacts, which a report does not need: ``<output>/training`` holds, for
everything that a study had to learn, ``<name>.csv`` (the log) and ``<name>.json`` (the artifact's provenance).
"""

from __future__ import annotations

import csv
import json
import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..core.hashing import digest
from ..core.io import write_atomically
from .artifacts import LOG, PROVENANCE, Artifacts, read_log
from .plan import Plan

FOLDER = "training"


@dataclass(frozen=True)
class Round:
    """The state at the end of a round; NaN for what was not logged.

    captures, seconds: taken so far, held-out captures included. predicted, captured: PSNR [dB] of predictions and of
    captures of held-out images against the images; fidelity: PSNR [dB] of the predictions against the captures.
    """

    number: int
    captures: float
    seconds: float
    predicted: float
    captured: float
    fidelity: float


@dataclass(frozen=True)
class TrainingRecord:
    """A finished training: its provenance as in the artifact, and its rounds, none if the method logged none."""

    provenance: Mapping[str, Any]
    rounds: tuple[Round, ...]

    @property
    def id(self) -> str:
        """The ``Preparation.id`` that the training is for."""
        return digest(self.provenance["description"])


def known(place: Path) -> dict[str, Any] | None:
    """An artifact's provenance without its tensors; None where there is none that can be read."""
    try:
        content = json.loads((place / PROVENANCE).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return content if isinstance(content, dict) and isinstance(content.get("description"), dict) else None


def keep_training_records(plan: Plan, artifacts: Artifacts, output: Path) -> None:
    """Copy logs and provenance of what a plan had to learn into ``output/training``.

    What is there stays when its artifact is not at hand any more; what the plan does not need goes.
    """
    needed, names = plan.preparations(), _names(plan)
    folder = output / FOLDER
    for old in (*folder.glob("*.json"), *folder.glob("*.csv")):
        if old.stem not in names.values():
            old.unlink()
    for identity, name in names.items():
        place = artifacts.place(needed[identity])
        provenance = known(place)
        if provenance is not None:
            log = place / LOG
            write_atomically(folder / f"{name}.csv", log.read_bytes() if log.is_file() else b"")
            write_atomically(folder / f"{name}.json", f"{json.dumps(provenance, indent=1)}\n".encode())


def _names(plan: Plan) -> dict[str, str]:
    """File names by preparation: the first label that needs it, and the display it is trained on."""
    titles = {
        task.preparation.id: f"{task.label} {task.preparation.place.name}"
        for task in reversed(plan.tasks)
        if task.preparation
    }
    names: dict[str, str] = {}
    for identity, needed in plan.preparations().items():
        title = titles.get(identity, f"display {needed.method} {needed.place.name}")
        stem = re.sub(r"[^A-Za-z0-9._-]+", "-", title).strip("-.")
        taken = {name.lower() for name in names.values()}  # some file systems do not tell A from a
        names[identity] = f"{stem}-{identity[:8]}" if stem.lower() in taken or not stem else stem
    return names


def training_records(output: Path) -> dict[str, TrainingRecord]:
    """The trainings beside a report by the id of what was to be learned; a file that is none is passed over."""
    found = []
    for path in sorted((output / FOLDER).glob("*.json")):
        try:
            provenance = json.loads(path.read_text(encoding="utf-8"))
        except ValueError:
            continue
        if isinstance(provenance, dict) and isinstance(provenance.get("description"), dict):
            found.append(TrainingRecord(provenance, rounds_of(path.with_suffix(".csv"))))
    return {one.id: one for one in found}


def rounds_of(log: Path) -> tuple[Round, ...]:
    """The rounds in a log, which may have other columns or none of these: then there are no rounds."""
    try:
        with log.open(encoding="utf-8", newline="") as file:
            return rounds_in(csv.DictReader(file))
    except (OSError, ValueError, csv.Error):
        return ()


def rounds_in(rows: Iterable[Mapping[str | Any, Any]]) -> tuple[Round, ...]:
    """The rounds in the rows of a log: of each round the last figure of every kind."""
    rounds: dict[int, dict[str, float]] = {}
    for row in rows:
        number = _number(row.get("round"))
        if math.isfinite(number):
            names = ("captures", "seconds", "predicted_psnr", "captured_psnr", "fidelity_psnr")
            figures = {name: _number(row.get(name)) for name in names}
            rounds.setdefault(int(number), {}).update({k: v for k, v in figures.items() if math.isfinite(v)})
    return tuple(
        Round(
            number,
            *(found.get(name, math.nan) for name in ("captures", "seconds")),
            *(found.get(f"{name}_psnr", math.nan) for name in ("predicted", "captured", "fidelity")),
        )
        for number, found in sorted(rounds.items())
    )


def _number(value: Any) -> float:
    try:
        return float(value)
    except (TypeError, ValueError):
        return math.nan


def progress(place: Path) -> tuple[float, float]:
    """Captures and seconds of an unfinished training by the last row of its log; NaN where it has none."""
    rows = rounds_in(read_log(place))
    return (rows[-1].captures, rows[-1].seconds) if rows else (math.nan, math.nan)
