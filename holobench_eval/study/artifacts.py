"""Learned states of trained methods: a folder each, shared by studies, made once and checked before use."""

from __future__ import annotations

import csv
import hashlib
import io
import json
import math
import shutil
import traceback
import zipfile
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from textwrap import shorten
from typing import IO, Any

import torch

from ..core.errors import UserError, reason
from ..core.hashing import State, digest, file_digest, file_state
from ..core.io import TEMPORARY, file_name, locked, open_regular, write_atomically
from ..display.account import Journal
from .displays import Preparation
from .isolation import changed

STATE, PROVENANCE, LOG, FAILURE = "learned.pt", "provenance.json", "training.csv", "failure.log"
UNFINISHED = "unfinished"
# Folder beside a report with the log (``<name>.csv``) and the provenance (``<name>.json``) of everything that its study
# had to learn. Both are small enough to be committed; a report does not need the tensors.
RECORDS = "training"
FORMAT = 1
REQUIRED = {"description": dict, "sha256": str, "log_sha256": str, "captures": int, "seconds": int | float}
AGAIN = "delete the folder and run again"
MOST_BYTES = 16_000_000_000  # of a file of tensors
ROUND = ("round", "captures", "seconds", "predicted_psnr", "captured_psnr", "fidelity_psnr")  # columns of a log
OTHER = {  # by the entry of a description
    "version": "other code",
    "external": "other files beside the code",
    "images_version": "other code of its images",
}


@dataclass(frozen=True)
class Artifact:
    """A learned state and where it comes from.

    state: what the method's ``prepare`` returned; provenance: its description, the captures and seconds it took, the
    sha256 of its file, and the versions of the code.
    """

    state: Mapping[str, Any]
    provenance: Mapping[str, Any]


@dataclass(frozen=True)
class Artifacts:
    """A folder of artifacts, one folder each, named by what they depend on."""

    folder: Path

    def folder_of(self, preparation: Preparation) -> Path:
        """The artifact's folder."""
        return self.folder / file_name(preparation.name)

    def has(self, preparation: Preparation) -> bool:
        """Whether the artifact exists, and the files that its training read are still the same; ``load`` checks it."""
        folder = self.folder_of(preparation)
        reads = (provenance_of(folder) or {}).get("reads")
        is_current = not isinstance(reads, dict) or not changed(reads, preparation.folder)
        return (folder / PROVENANCE).is_file() and is_current

    def networks(self, preparations: Iterable[Preparation]) -> dict[str, str]:
        """The sha256 of the states that are there, by ``Preparation.id``; empty for one whose training read a file that
        has changed."""
        return {
            each.id: str(known.get("sha256")) if self.has(each) else ""
            for each in preparations
            if (known := provenance_of(self.folder_of(each)))
        }

    def outdated(self, preparation: Preparation) -> str:
        """In words, the artifact that would do, were it not of other code or other files; empty where there is none."""
        wanted, stem = preparation.description(), preparation.name.rpartition("-")[0]
        for folder in sorted(self.folder.glob(f"{file_name(stem)}-*")):
            trained = (provenance_of(folder) or {}).get("description", {})
            differing = {key for key in {*wanted, *trained} if trained.get(key) != wanted.get(key)}
            if trained and differing and differing <= OTHER.keys():
                of = " and ".join(OTHER[key] for key in sorted(differing, reverse=True))
                return f"{folder} was learned with {of}"
        return ""

    def load(self, preparation: Preparation) -> Artifact:
        """The artifact, once for a process. UserError: damaged, foreign, or made for something else."""
        folder = self.folder_of(preparation)
        states = file_state(folder / STATE), file_state(folder / LOG)
        try:
            described = (folder / PROVENANCE).read_bytes() if states[0] else None
        except OSError:
            described = None
        if described is None:
            raise UserError(f"{folder}: {STATE} or {PROVENANCE} is missing; {AGAIN}")
        artifact = _loaded(folder, states, described)
        trained, wanted = artifact.provenance["description"], preparation.description()
        for key in wanted:
            if trained.get(key) != wanted[key]:
                own, other = (shorten(json.dumps(value), 80) for value in (wanted[key], trained.get(key)))
                found = f"trained for {key.replace('_', ' ')} {other}, this study needs {own}"
                raise UserError(f"{folder}: {found}; delete it, or give --retrain")
        return artifact

    def write(self, preparation: Preparation, state: Mapping[str, Any], facts: Mapping[str, Any]) -> None:
        """Keep a learned state; facts: further entries of its provenance. The unfinished training is removed."""
        folder, content = self.folder_of(preparation), packed({"format": FORMAT, "state": dict(state)})
        write_atomically(folder / STATE, content)
        sha256 = hashlib.sha256(content).hexdigest()
        described = {
            "format": FORMAT,
            "sha256": sha256,
            "log_sha256": file_digest(folder / LOG),
            "description": preparation.description(),
            **facts,
        }
        write_atomically(folder / PROVENANCE, f"{json.dumps(described, indent=1)}\n".encode())
        (folder / FAILURE).unlink(missing_ok=True)
        shutil.rmtree(folder / UNFINISHED, ignore_errors=True)

    def remove(self, preparation: Preparation) -> None:
        """Delete an artifact, finished or not, so that it is trained again.

        Its captures go with it: they are not those of the artifact that takes its place.
        """
        shutil.rmtree(self.folder_of(preparation), ignore_errors=True)

    def fail(self, preparation: Preparation, error: BaseException) -> str:
        """Write down the traceback of a failed training and return the reason in one line."""
        line = reason(error)
        text = "\n\n".join([line, "".join(traceback.format_exception(error))])
        write_atomically(self.folder_of(preparation) / FAILURE, text.encode("utf-8", "backslashreplace"))
        return line

    def failure(self, preparation: Preparation) -> str:
        """The reason why an artifact is missing, in one line."""
        try:
            lines = (self.folder_of(preparation) / FAILURE).read_text(encoding="utf-8").splitlines()
        except OSError:
            return "it was not tried"
        return lines[0] if lines else "no reason was kept"

    @contextmanager
    def locked(self, preparation: Preparation) -> Iterator[None]:
        """Let other processes that want to make the same artifact wait."""
        folder = self.folder_of(preparation)
        with locked(folder / ".lock"):
            for left in folder.rglob(f"{TEMPORARY}*"):
                left.unlink()
            yield

    def memory(self, preparation: Preparation) -> FolderMemory:
        """Where an unfinished training is kept."""
        return FolderMemory(self.folder_of(preparation))


@dataclass(frozen=True)
class FolderMemory:
    """Values of an unfinished training, a file each, and its log. folder: the artifact's."""

    folder: Path

    def load(self, name: str) -> dict[str, Any] | None:
        """The value of a name; None if there is none. UserError for a damaged file."""
        path = self._path(name)
        return None if not path.exists() else read_tensors(path)

    def save(self, name: str, value: dict[str, Any]) -> None:
        """Write a value; an interrupted write leaves the earlier file."""
        write_atomically(self._path(name), packed(value))

    def log(self, row: Mapping[str, float | int | str]) -> None:
        """Add a row to ``training.csv``, ordered by round and step; rows of the same round and step are merged."""
        new = {key: f"{value:.6g}" if isinstance(value, float) else str(value) for key, value in row.items()}
        position, rows = _round_and_step(row), read_log(self.folder)
        earlier = next((old for old in rows if position and _round_and_step(old) == position), None)
        if earlier is None:
            rows.append(new)
        else:
            earlier |= new
        if all(entry.get(name, "").isdigit() for entry in rows for name in ("round", "step")):
            rows.sort(key=lambda entry: (int(entry["round"]), int(entry["step"])))
        text = io.StringIO()
        writer = csv.DictWriter(text, list(dict.fromkeys(key for entry in rows for key in entry)), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
        write_atomically(self.folder / LOG, text.getvalue().encode())

    @property
    def journal(self) -> Journal:
        """The captures that the training took, those of attempts that failed included."""
        return Journal(self.folder / UNFINISHED / "captures")

    def _path(self, name: str) -> Path:
        return self.folder / UNFINISHED / f"{file_name(name)}.pt"


def _round_and_step(row: Mapping[str, Any]) -> dict[str, str]:
    """Round and step of a row, as far as it has them."""
    return {name: str(row[name]) for name in ("round", "step") if row.get(name) not in (None, "")}


def read_log(folder: Path) -> list[dict[str, str]]:
    """The rows of an artifact's ``training.csv``, empty if there is none."""
    try:
        with (folder / LOG).open(encoding="utf-8", newline="") as file:
            return list(csv.DictReader(file))
    except FileNotFoundError:
        return []


def packed(value: dict[str, Any]) -> bytes:
    """Tensors and plain values as what a file holds, for ``read_tensors``."""
    buffer = io.BytesIO()
    torch.save(value, buffer)
    return buffer.getvalue()


def read_tensors(path: Path, file: IO[bytes] | None = None) -> dict[str, Any]:
    """Tensors and plain values from a file that may be hostile. UserError for one that is damaged or holds code, or
    that would take more memory than it has bytes.

    file: what the path holds, where it has been read.
    """
    try:
        with nullcontext(file) if file else open_regular(path, MOST_BYTES) as opened:
            with zipfile.ZipFile(opened) as archive:
                decoded = sum(entry.file_size for entry in archive.infolist())
            if decoded > opened.seek(0, io.SEEK_END):
                raise ValueError(f"it would be unpacked to {decoded / 1e9:.1f} GB")
            opened.seek(0)
            content = torch.load(opened, map_location="cpu", weights_only=True)
    except UserError:
        raise
    except Exception as error:  # damaged bytes raise whatever they happen to mean
        reason = str(error).partition("\n")[0][:120]
        fault = f"damaged, or not a file of tensors ({reason})"
        raise UserError(f"{path}: {fault}; delete its folder and run again") from None
    if not isinstance(content, dict):
        raise UserError(f"{path}: holds no mapping; delete its folder and run again")
    return content


@lru_cache(maxsize=4)
def _loaded(folder: Path, _states: tuple[State | None, ...], described: bytes) -> Artifact:
    provenance = _provenance(folder / PROVENANCE, described)
    content = read_tensors(folder / STATE)
    for name, key in ((STATE, "sha256"), (LOG, "log_sha256")):
        if file_digest(folder / name) != provenance[key]:
            raise UserError(f"{folder / name}: is not the file that {PROVENANCE} describes; {AGAIN}")
    if content.get("format") != FORMAT or not isinstance(content.get("state"), dict):
        raise UserError(f"{folder / STATE}: of another version; {AGAIN}")
    return Artifact(content["state"], provenance)


def _provenance(path: Path, text: bytes) -> dict[str, Any]:
    """A provenance with every required entry. UserError names what is missing or invalid."""
    try:
        content = json.loads(text)
    except (ValueError, RecursionError):
        content = None
    if not isinstance(content, dict):
        raise UserError(f"{path}: not an artifact's provenance; {AGAIN}")
    if content.get("format") != FORMAT:
        raise UserError(f"{path}: of another version; {AGAIN}")
    for key, kind in REQUIRED.items():
        if not isinstance(content.get(key), kind):
            raise UserError(f"{path}: has no valid '{key}'; {AGAIN}")
    return content


@dataclass(frozen=True)
class Round:
    """The state at the end of a round, in the order of ``ROUND``; NaN for what was not logged.

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


def provenance_of(folder: Path) -> dict[str, Any] | None:
    """An artifact's provenance, read without its tensors; None where it is missing or unreadable."""
    return _described(folder / PROVENANCE)


def _described(path: Path) -> dict[str, Any] | None:
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return content if isinstance(content, dict) and isinstance(content.get("description"), dict) else None


def training_records(output: Path) -> dict[str, TrainingRecord]:
    """The trainings beside a report, by ``Preparation.id``; files that are no provenance are skipped."""
    records = {}
    for path in sorted((output / RECORDS).glob("*.json")):
        if (provenance := _described(path)) is not None:
            record = TrainingRecord(provenance, rounds_of(path.with_suffix(".csv")))
            records[record.id] = record
    return records


def rounds_of(log: Path) -> tuple[Round, ...]:
    """The rounds in a log, each with the last finite figure of every column; none where the log lacks these columns."""
    import pandas as pd  # which workers need not load

    try:
        logged = pd.read_csv(log, dtype=str).reindex(columns=ROUND)
    except (OSError, ValueError):
        return ()
    figures = logged.apply(pd.to_numeric, errors="coerce").replace([math.inf, -math.inf], math.nan)
    return tuple(Round(int(row[0]), *row[1:]) for row in figures.groupby("round").last().itertuples())


def progress(folder: Path) -> tuple[float, float]:
    """Captures of an unfinished training, and its seconds up to the last round in its log; NaN where unknown."""
    rows = rounds_of(folder / LOG)
    captures, seconds = (rows[-1].captures, rows[-1].seconds) if rows else (math.nan, math.nan)
    return FolderMemory(folder).journal.captures or captures, seconds
