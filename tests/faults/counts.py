"""What a virtual camera counts by itself, and what is reported: for each target, and for the training."""

import json
import os
from collections.abc import Sequence
from pathlib import Path

from holobench_eval.study.artifacts import progress, provenance_of

COUNTS = Path("counts")  # files with a line for each capture, written as the camera is asked
TRAINING = "training"
CAMERA = "mine"  # the method that has one


def note(names: Sequence[object]) -> str:
    """Count a capture in the name of a session. What it was taken for: the training, a target, or (empty) a score."""
    of = TRAINING if TRAINING in names else str(names[-3]) if names[-1] == "solve" else ""
    if of:
        COUNTS.mkdir(exist_ok=True)
        with (COUNTS / of).open("a") as file:
            file.write(f"{os.getpid()}\n")
    return of


def taken(folder: Path, of: str) -> int:
    """How many captures the camera has counted."""
    path = folder / COUNTS / of
    return len(path.read_text().splitlines()) if path.exists() else 0


def account(path: Path) -> str:
    """What the captures were taken for whose account ends with a file of the results; empty for none."""
    if path.suffix != ".json":
        return ""
    record = json.loads(path.read_text())
    return record["target"] if record.get("label") == CAMERA and record["state"] == "done" else ""


def forget(folder: Path, of: str) -> None:
    """Begin a new count."""
    if of:
        (folder / COUNTS / of).unlink(missing_ok=True)


def reported(folder: Path, label: str = CAMERA) -> dict[str, float]:
    """The captures in the records of a method with a camera, and in the artifact of the one training."""
    captures: dict[str, float] = {}
    for path in (folder / "out/records").glob("*.json"):
        record = json.loads(path.read_text())
        if record["label"] == label:
            captures[record["target"]] = record["captures"]
    for artifact in (folder / "artifacts").glob("*"):
        captures[TRAINING] = (provenance_of(artifact) or {}).get("captures", progress(artifact)[0])
    return captures
