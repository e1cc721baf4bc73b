"""Faults at random moments of a small study, each followed by the same command; then the study against one without.

A study is planned, trained, solved, scored, written and reported by a process of its own, and is hit once in each life.
Some studies run on the simulated display, some on a panel and a camera.
"""

import csv
import io
import json
import os
import random
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from holobench_eval.core.hashing import digest
from holobench_eval.study.executors.processes import PRELOADED, start
from holobench_eval.study.phases import phases_of
from tests.faults.counts import CAMERA, account, forget, reported, taken
from tests.faults.life import DEVICES, PHOTOGRAPHING, SAID, SIMULATED, TRACEBACK, begin, ends, live
from tests.faults.system import FAULTS, FAULTS_AT_CAPTURES, FAULTS_OF_DEVICES

# of a record: what differs from run to run, and its digest
TIMES = {"seconds", "reused", "memory_mib", "cpu_s", "alone", "sha256"}
CAPTURES = "captures"  # those of attempts that a fault has ended count, too; they are compared with the camera's


@dataclass
class Count:
    """What a campaign has seen. late: faults that met no life; told: how lives ended that ended wrongly; counted:
    numbers of captures that were compared with the camera's; surplus: captures that were counted and not taken, since
    the fault came between; miscounted: numbers that are wrong all the same."""

    faults: dict[str, int] = field(default_factory=dict)
    studies: int = 0
    lost: int = 0
    doubled: int = 0
    wrong: int = 0
    tables: int = 0
    hung: int = 0
    holes: int = 0
    tracebacks: int = 0
    late: int = 0
    counted: int = 0
    surplus: int = 0
    miscounted: int = 0
    told: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class Kind:
    """A kind of study: its files, what can happen to it, and where it is computed in peace, see `executor`."""

    files: dict[str, str]
    faults: dict[str, Any]
    where: str


KINDS = (
    Kind(SIMULATED, FAULTS, "workers"),
    Kind(DEVICES, FAULTS_OF_DEVICES, "serial"),
    Kind(PHOTOGRAPHING, FAULTS_AT_CAPTURES, "workers"),
)


@dataclass(frozen=True)
class Whole:
    """A study that nothing happened to: its records, its table, and how long it lived [s]."""

    kind: Kind
    records: dict[str, Any]
    table: str
    length: float


def study(folder: Path, draw: random.Random, faults: list[str], wanted: Whole, seen: Count) -> None:
    """Let a study live through faults, then in peace, and compare what it is at the end."""
    begin(folder, wanted.kind.files)
    for name in faults:
        # Each draws for itself, so that the seed fixes moments whatever was done by then.
        unfinish(folder, random.Random(draw.random()))
        fault = wanted.kind.faults[name](folder, random.Random(draw.random()), wanted.length)
        process = next(fault)
        hit = next(fault, None)
        for _ in fault:
            pass
        ended = ends(process)
        # What tells nothing of itself, such as a limit, has hit a life that did not end well.
        if process.exitcode != 0 if hit is None else hit:
            seen.faults[name] = seen.faults.get(name, 0) + 1
        else:
            seen.late += 1
        seen.hung += not ended
        seen.tracebacks += process.exitcode == TRACEBACK
        if not ended or process.exitcode == TRACEBACK:
            seen.told.append(f"{name}: {'hung' if not ended else (folder / SAID).read_text().splitlines()[-1]}")
    last = start(live, folder, "serial", None, True)
    seen.hung += not ends(last)
    seen.holes += last.exitcode != 0
    compare(folder, wanted, seen)
    count(folder, sum(name not in FAULTS_AT_CAPTURES for name in faults), seen)


def unfinish(folder: Path, draw: random.Random) -> None:
    """Take away half of the records with their phases, so that the next life has something to do."""
    for path in sorted((folder / "out/records").glob("*.json")):
        if draw.random() < 0.5:
            record = json.loads(path.read_text())
            phase = phases_of(folder / "out").path(digest(record["capture"]["phase"]))
            is_solved = record["label"] == CAMERA and phase.exists()  # though it may have failed to be scored
            forget(folder, record["target"] if is_solved else account(path))  # made again, it begins a new account
            path.unlink()
            phase.unlink(missing_ok=True)


def records(folder: Path) -> dict[str, Any]:
    """The records of a study by their names, without times and captures."""
    found = {}
    for path in sorted((folder / "out/records").glob("*.json")):
        content = json.loads(path.read_text())
        if content["learned"]:
            del content["learned"]["seconds"], content["learned"][CAPTURES]
        found[path.name] = {key: value for key, value in content.items() if key not in {*TIMES, CAPTURES}}
    return found


def table(folder: Path) -> str:
    """The table without its columns of times, memory and captures."""
    rows = list(csv.reader(io.StringIO((folder / "out/table.csv").read_text())))
    kept = [i for i, name in enumerate(rows[0]) if not name.endswith(("_s", "_mib", CAPTURES))]
    return "\n".join(",".join(row[i] for i in kept) for row in rows)


def compare(folder: Path, wanted: Whole, seen: Count) -> None:
    """Count what differs from the study without a fault."""
    found = records(folder)
    seen.studies += 1
    seen.lost += len(wanted.records.keys() - found.keys())
    seen.doubled += len(found.keys() - wanted.records.keys())
    seen.wrong += sum(found[name] != record for name, record in wanted.records.items() if name in found)
    seen.tables += table(folder) != wanted.table


def count(folder: Path, faults: int, seen: Count) -> None:
    """Compare the captures that are reported with those that the camera has counted; each of so many faults may have
    come between the two."""
    for of, captures in reported(folder).items():
        surplus = captures - taken(folder, of)
        seen.counted += 1
        seen.surplus += int(max(0, surplus))
        seen.miscounted += not 0 <= surplus <= faults


def without_fault(kind: Kind, folder: Path) -> Whole:
    """A study of the kind that nothing happens to."""
    begin(folder, kind.files)
    if "tests.faults.life" not in PRELOADED:
        PRELOADED.append("tests.faults.life")  # else every life would import the report anew
    start(os.getpid).join()  # the process that lives are forked from has imported all
    began = time.monotonic()
    process = start(live, folder, kind.where)
    if not ends(process) or process.exitcode != 0:
        raise RuntimeError(f"the study without a fault ends with {process.exitcode}")
    return Whole(kind, records(folder), table(folder), time.monotonic() - began)
