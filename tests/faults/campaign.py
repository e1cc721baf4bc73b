"""Faults at random moments of a small study, each followed by the same command; then the study against one without.

A study is planned, trained, solved, scored, written and reported by a process of its own, and is hit once in each life.
Some studies run on the simulated display, some on a panel and a camera.
"""

from __future__ import annotations

import csv
import io
import json
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from multiprocessing import forkserver
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any

from holobench_eval.core.errors import UserError
from holobench_eval.report.data.layout import layout_of
from holobench_eval.report.data.results import Results
from holobench_eval.report.data.tables import records_frame
from holobench_eval.report.files import write_files
from holobench_eval.study.config import load_study
from holobench_eval.study.executors import Executor, Serial
from holobench_eval.study.executors.clusters import Address
from holobench_eval.study.executors.local import Local
from holobench_eval.study.executors.processes import PRELOADED, start
from holobench_eval.study.plan import plan
from holobench_eval.study.progress import Lines
from holobench_eval.study.run import run
from tests.faults import devices

TIMES = {"seconds", "memory_mib", "alone", "sha256"}  # of a record: what differs from run to run, and its digest
LONGEST = 300.0  # seconds that a life may take before it counts as hung

METHOD = """
from dataclasses import dataclass
from typing import ClassVar

import torch


@dataclass(frozen=True)
class Mine:
    camera: ClassVar[bool] = True

    def solve(self, target, bench):
        phase = torch.rand((*target.shape[:2], *bench.spec.shape), generator=bench.generator("start"))
        for _ in range(3):
            phase = phase + bench.rectify(bench.capture(phase[0])).mean()
        return phase
"""

STUDY = """title: faults
display: {profiles: [leto-mild], panel: [128, 160]}
targets: {dataset: photographs, params: {count: 2}}
training: {dataset: dead_leaves, params: {count: 4}, held_out: 1}
protocol: {metrics: [psnr]}
methods:
  - double_phase
  - {name: wirtinger, params: {iterations: 5}}
  - {name: "mine.py:Mine", captures: 3}
  - {name: parametric_model, params: {training: {rounds: 1, images: 2, steps: 3}}}
"""


SIMULATED = {"mine.py": METHOD, "study.yaml": STUDY}
DEVICES = {"mine.py": METHOD, **devices.FILES}
WORKERS = 2
TRACEBACK = 3  # how a life ends that ends with one
IMPORTS = 1.0  # seconds that a life on a Dask cluster takes to begin


@dataclass
class Count:
    """What a campaign has seen."""

    faults: dict[str, int] = field(default_factory=dict)
    studies: int = 0
    lost: int = 0
    doubled: int = 0
    wrong: int = 0
    tables: int = 0
    hung: int = 0
    holes: int = 0
    tracebacks: int = 0


def executor(name: str) -> Executor:
    """One by one, on two workers of this machine, or on those of a Dask scheduler."""
    return {"serial": Serial(), "workers": Local(WORKERS)}.get(name) or Address(name)


def live(
    folder: Path,
    where: str = "serial",
    limits: dict[int, int] | None = None,
    peace: bool = False,
    fault: devices.Fault | None = None,
) -> None:
    """One life of a study: the run and its files of numbers. It ends with 0, with 1 for holes, with 2 for a refusal.

    where: see `executor`; peace: cells that failed are tried again; fault: of its devices.
    """
    os.chdir(folder)
    for output in (1, 2):
        os.dup2(os.open("said.txt", os.O_WRONLY | os.O_CREAT | os.O_APPEND), output)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    for limit, value in (limits or {}).items():
        resource.setrlimit(limit, (value, value))
    if Path("bench.yaml").is_file():
        devices.failing(fault)
    try:
        study = load_study(Path("study.yaml"))
        planned, watch = plan(study), Lines(lambda _: None)
        outcome = run(study, planned, Path("out"), executor(where), watch, 1, Path("artifacts"), retry_failed=peace)
        layout = layout_of(study)
        write_files(Results(records_frame(outcome.records, layout), layout), Path("out"))
    except (UserError, OSError, MemoryError):  # which the command says in one line
        os._exit(2)
    except Exception:
        traceback.print_exc()
        os._exit(TRACEBACK)
    os._exit(1 if outcome.failed else 0)


def begin(folder: Path, files: dict[str, str]) -> None:
    """A folder with the files of a study."""
    folder.mkdir(parents=True)
    for name, content in files.items():
        (folder / name).write_text(content)


def ends(process: BaseProcess) -> bool:
    """Wait for the end of a life; whether it came."""
    process.join(LONGEST)
    if process.is_alive():
        process.kill()
        process.join()
        return False
    return True


def others(driver: BaseProcess) -> list[int]:
    """Workers, processes of methods and their calls."""
    parents: dict[int, int] = {}
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            with suppress(OSError, ValueError):
                parents[int(entry.name)] = int((entry / "stat").read_text().rpartition(")")[2].split()[1])
    server = forkserver._forkserver._forkserver_pid  # type: ignore[attr-defined]
    family = [server]
    for process in family:
        family += [child for child, parent in parents.items() if parent == process]
    return [process for process in family[1:] if process != driver.pid]


def kills(number: int, of: Callable[[BaseProcess], list[int]]) -> Callable[..., Iterator[BaseProcess]]:
    """A fault: a signal to one of some processes, at a random moment."""

    def fault(folder: Path, draw: random.Random, length: float) -> Iterator[BaseProcess]:
        process = start(live, folder, "workers" if draw.random() < 0.7 and not on_devices(folder) else "serial")
        yield process
        time.sleep(draw.random() * length)
        if victims := of(process):
            with suppress(ProcessLookupError):
                os.kill(draw.choice(victims), number)

    return fault


def limits(limit: int, low: int, high: int) -> Callable[..., Iterator[BaseProcess]]:
    """A fault: a limit of the system that is met sooner or later, drawn evenly in its logarithm."""

    def fault(folder: Path, draw: random.Random, length: float) -> Iterator[BaseProcess]:
        yield start(live, folder, "serial", {limit: round(low * (high / low) ** draw.random())})

    return fault


def full_disk(folder: Path, draw: random.Random, length: float) -> Iterator[BaseProcess]:
    """A fault: the disk of the results is full after some kilobytes. Only root can mount one."""
    disk = folder / "out"
    disk.mkdir(exist_ok=True)
    kept = folder / "kept"
    subprocess.run(["cp", "-a", str(disk), str(kept)], check=True)
    held = sum(path.stat().st_blocks * 512 for path in disk.rglob("*") if path.is_file())
    size = held + draw.randint(8, 400) * 1024
    subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", str(disk)], check=True)
    try:
        with suppress(subprocess.CalledProcessError):
            subprocess.run(["cp", "-a", f"{kept}/.", str(disk)], check=True, stderr=subprocess.DEVNULL)
        process = start(live, folder, draw.choice(["serial", "workers"]))
        yield process
        process.join(LONGEST)
        subprocess.run(["rm", "-rf", str(kept)], check=True)
        subprocess.run(["cp", "-a", str(disk), str(kept)], check=True)
    finally:
        subprocess.run(["umount", "-l", str(disk)], check=True)
    subprocess.run(["cp", "-a", f"{kept}/.", str(disk)], check=True)
    subprocess.run(["rm", "-rf", str(kept)], check=True)


def two_runs(folder: Path, draw: random.Random, length: float) -> Iterator[BaseProcess]:
    """A fault: the same command twice at once."""
    first = start(live, folder, "workers")
    yield first
    time.sleep(draw.random() * length)
    second = start(live, folder)
    assert ends(second)
    first.join(LONGEST)


def dask(victim: int) -> Callable[..., Iterator[BaseProcess]]:
    """A fault: the scheduler of a Dask cluster (victim 0) or one of its workers is killed."""

    def fault(folder: Path, draw: random.Random, length: float) -> Iterator[BaseProcess]:
        known = folder / "scheduler.json"
        known.unlink(missing_ok=True)
        file = ["--scheduler-file", str(known)]
        commands = [["scheduler", "--port", "0", "--no-dashboard", *file]]
        commands += [["worker", "--nthreads", "1", "--no-dashboard", "--no-nanny", *file]] * WORKERS
        cluster = []
        try:
            for command in commands:
                cluster.append(
                    subprocess.Popen(
                        [sys.executable, "-m", "distributed.cli.dask_" + command[0], *command[1:]],
                        stdout=subprocess.DEVNULL,
                        stderr=subprocess.DEVNULL,
                        cwd=folder,
                    )
                )
                while not known.exists():
                    time.sleep(0.05)
            process = start(live, folder, json.loads(known.read_text())["address"])
            yield process
            time.sleep(IMPORTS + draw.random() * length)
            cluster[victim].kill()
            process.join(LONGEST)
        finally:
            for each in cluster:
                each.kill()
                each.wait()

    return fault


def on_devices(folder: Path) -> bool:
    """Whether a study photographs with devices, which are those of one process."""
    return (folder / "bench.yaml").is_file()


FAULTS: dict[str, Any] = {
    "the run is killed": kills(signal.SIGKILL, lambda driver: [driver.pid or 0]),
    "the run is told to end": kills(signal.SIGTERM, lambda driver: [driver.pid or 0]),
    "the run is interrupted": kills(signal.SIGINT, lambda driver: [driver.pid or 0]),
    "a worker or a method's process is killed": kills(signal.SIGKILL, others),
    "a worker or a method's process aborts": kills(signal.SIGABRT, others),
    "files have a largest size": limits(resource.RLIMIT_FSIZE, 200, 300_000),
    "few files may be open": limits(resource.RLIMIT_NOFILE, 12, 80),
    "memory is short": limits(resource.RLIMIT_DATA, 50 * 2**20, 2**31),
    "the disk is full": full_disk,
    "two runs at once": two_runs,
    "the Dask scheduler is killed": dask(0),
    "a Dask worker is killed": dask(1),
}


def device(kind: str, least: int, most: int) -> Callable[..., Iterator[BaseProcess]]:
    """A fault: from a random moment on, a device fails so many times."""
    return devices.fails(lambda folder, fault: start(live, folder, "serial", None, False, fault), kind, least, most)


FAULTS_OF_DEVICES: dict[str, Any] = {
    "a frame does not come": device("late", 1, 6),
    "an old frame comes": device("old", 1, 6),
    "a frame of another size comes": device("small", 1, 6),
    "the panel does not answer": device("panel", 1, 6),
    "the camera vanishes": device("late", devices.FOREVER, devices.FOREVER),
    "the panel vanishes": device("panel", devices.FOREVER, devices.FOREVER),
    "the run on devices is killed": FAULTS["the run is killed"],
}


@dataclass(frozen=True)
class Kind:
    """A kind of study: its files, what can happen to it, and where it is computed in peace, see `executor`."""

    files: dict[str, str]
    faults: dict[str, Any]
    where: str


KINDS = (Kind(SIMULATED, FAULTS, "workers"), Kind(DEVICES, FAULTS_OF_DEVICES, "serial"))


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
        fault = wanted.kind.faults[name](folder, draw, wanted.length)
        process = next(fault)
        next(fault, None)
        seen.faults[name] = seen.faults.get(name, 0) + 1
        seen.hung += not ends(process)
        seen.tracebacks += process.exitcode == TRACEBACK
    last = start(live, folder, "serial", None, True)
    seen.hung += not ends(last)
    seen.holes += last.exitcode != 0
    compare(folder, wanted, seen)


def records(folder: Path) -> dict[str, Any]:
    """The records of a study by their names, without times."""
    found = {}
    for path in sorted((folder / "out/records").glob("*.json")):
        content = json.loads(path.read_text())
        if content["learned"]:
            del content["learned"]["seconds"]
        found[path.name] = {key: value for key, value in content.items() if key not in TIMES}
    return found


def table(folder: Path) -> str:
    """The table without its columns of times and memory."""
    rows = list(csv.reader(io.StringIO((folder / "out/table.csv").read_text())))
    kept = [i for i, name in enumerate(rows[0]) if not name.endswith(("_s", "_mib"))]
    return "\n".join(",".join(row[i] for i in kept) for row in rows)


def compare(folder: Path, wanted: Whole, seen: Count) -> None:
    """Count what differs from the study without a fault."""
    found = records(folder)
    seen.studies += 1
    seen.lost += len(wanted.records.keys() - found.keys())
    seen.doubled += len(found.keys() - wanted.records.keys())
    seen.wrong += sum(found[name] != record for name, record in wanted.records.items() if name in found)
    seen.tables += table(folder) != wanted.table


def without_fault(kind: Kind, folder: Path) -> Whole:
    """A study of the kind that nothing happens to."""
    begin(folder, kind.files)
    if "tests.faults.campaign" not in PRELOADED:
        PRELOADED.append("tests.faults.campaign")  # else every life would import the report anew
    start(live, folder, kind.where).join()
    shutil.rmtree(folder)
    begin(folder, kind.files)
    began = time.monotonic()
    process = start(live, folder, kind.where)
    if not ends(process) or process.exitcode != 0:
        raise RuntimeError(f"the study without a fault ends with {process.exitcode}")
    return Whole(kind, records(folder), table(folder), time.monotonic() - began)
