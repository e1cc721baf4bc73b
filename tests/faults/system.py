"""Faults of the system: signals, limits, a full disk, two runs at once, a Dask cluster that is lost.

A fault is a generator: it gives the life that it is about to hit, then hits it, and may tell whether the life was still
going on.
"""

import json
import os
import random
import resource
import shutil
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from importlib import import_module
from multiprocessing import forkserver
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any

import psutil

from holobench_eval.study.executors.processes import number_within, start
from tests.faults import devices
from tests.faults.counts import TRAINING, account, forget, taken
from tests.faults.life import LONGEST, PLANNED, REFUSED, SAID, TARGETS, WORKERS, ends, live, on_devices

Told = Iterator[Any]  # the process of a life, then whether it was hit
IMPORTS = 1.0  # seconds that a life on a Dask cluster takes to begin
ROOT = Path(__file__).parents[2]
ANSWER = 60.0  # seconds that a Dask cluster has to begin


def others(driver: BaseProcess) -> list[int]:
    """Workers, processes of methods and their calls."""
    server = psutil.Process(forkserver._forkserver._forkserver_pid)  # type: ignore[attr-defined]
    return [process.pid for process in server.children(recursive=True) if process.pid != driver.pid]


def kills(number: int, of: Callable[[BaseProcess], list[int]]) -> Callable[..., Told]:
    """A fault: a signal to one of some processes, at a random moment."""

    def fault(folder: Path, draw: random.Random, length: float) -> Told:
        where, when, which = draw.random(), draw.random(), draw.random()
        process = start(live, folder, "workers" if where < 0.7 and not on_devices(folder) else "serial")
        yield process
        time.sleep(when * length)
        victims = of(process) if process.is_alive() else []
        if victims:
            with suppress(ProcessLookupError):
                os.kill(victims[int(which * len(victims))], number)
        yield bool(victims)

    return fault


def limits(limit: int, low: int, high: int) -> Callable[..., Told]:
    """A fault: a limit of the system that is met sooner or later, drawn evenly in its logarithm."""

    def fault(folder: Path, draw: random.Random, length: float) -> Told:
        yield start(live, folder, "serial", {limit: round(low * (high / low) ** draw.random())})

    return fault


def at_capture(kind: str) -> Callable[..., Told]:
    """A fault: the camera carries it out at one of the next captures of each target, or of the training. So it meets
    the capture that was drawn for it, however busy the machine is."""

    def fault(folder: Path, draw: random.Random, length: float) -> Told:
        planned = folder / PLANNED
        shutil.rmtree(planned, ignore_errors=True)
        planned.mkdir()
        of_all = (*TARGETS, TRAINING) if kind == "kill" else TARGETS  # a shipped method takes any frame
        for of in of_all:
            (planned / f"{of} {taken(folder, of) + draw.randint(1, 3)}").write_text(kind)
        process = start(live, folder, draw.choice(["serial", "workers"]))
        yield process
        process.join(LONGEST)
        yield len(list(planned.iterdir())) < len(of_all)
        shutil.rmtree(planned)

    return fault


def called(driver: BaseProcess) -> list[int]:
    """Processes that answer calls of methods: each is of a namespace, and not its first."""
    return [number for number in others(driver) if number_within(number) not in (0, 1, number)]


def damaged(folder: Path, draw: random.Random, length: float) -> Told:
    """A fault: a bit of a file of the results is another one, or the file ends early. What the run refuses by its name
    is deleted, as the message says."""
    kept = [path for part in ("out", "artifacts") for path in sorted((folder / part).rglob("*")) if path.is_file()]
    for path in draw.sample(kept, min(1, len(kept))):
        count = account(path)
        content = bytearray(path.read_bytes()) or bytearray(1)
        at = draw.randrange(len(content))
        if draw.random() < 0.5:
            del content[at:]
        else:
            content[at] ^= 1 << draw.randrange(8)
        path.write_bytes(content)
    process = start(live, folder, "serial")
    yield process
    process.join(LONGEST)
    if process.exitcode == REFUSED:
        named, _, cure = (folder / SAID).read_text().splitlines()[-1].partition(":")
        if folder / named == path and "folder" not in cure:
            path.unlink()
            forget(folder, count)
        elif folder / named in (path, path.parent):
            shutil.rmtree(path.parent)
            forget(folder, TRAINING)
    yield bool(kept)


def full_disk(folder: Path, draw: random.Random, length: float) -> Told:
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


def two_runs(folder: Path, draw: random.Random, length: float) -> Told:
    """A fault: the same command twice at once."""
    first = start(live, folder, "workers")
    yield first
    time.sleep(draw.random() * length)
    both = first.is_alive()
    second = start(live, folder)
    assert ends(second)
    first.join(LONGEST)
    yield both


def dask(victim: int) -> Callable[..., Told]:
    """A fault: the scheduler of a Dask cluster (victim 0) or one of its workers is killed."""

    def fault(folder: Path, draw: random.Random, length: float) -> Told:
        known = folder / "scheduler.json"
        known.unlink(missing_ok=True)
        file = ["--scheduler-file", str(known), "--no-dashboard"]
        members = [("scheduler", "--port", "0"), *[("worker", "--nthreads", "1", "--no-nanny")] * WORKERS]
        cluster = [start(_member, folder, *member, *file) for member in members]
        try:
            process = start(live, folder, _address(known))
            yield process
            time.sleep(IMPORTS + draw.random() * length)
            hit = process.is_alive()
            cluster[victim].kill()
            process.join(LONGEST)
            yield hit
        finally:
            for each in cluster:
                each.kill()
                each.join(LONGEST)

    return fault


def _member(folder: Path, kind: str, *options: str) -> None:
    """The scheduler or a worker of a Dask cluster, as its command starts it, in a process that has imported torch."""
    os.chdir(folder)
    for output in (1, 2):
        os.dup2(os.open(os.devnull, os.O_WRONLY), output)
    import_module(f"distributed.cli.dask_{kind}").main(list(options))


def _address(known: Path) -> str:
    """The address of a Dask scheduler whose workers have come. RuntimeError: the cluster does not begin."""
    from distributed import Client

    until = time.monotonic() + ANSWER
    while not known.exists() or not known.stat().st_size:
        if time.monotonic() > until:
            raise RuntimeError("no Dask scheduler begins")
        time.sleep(0.05)
    address = str(json.loads(known.read_text())["address"])
    with Client(address, timeout=ANSWER) as client:
        client.wait_for_workers(WORKERS, timeout=ANSWER)
    return address


FAULTS: dict[str, Any] = {
    "the run is killed": kills(signal.SIGKILL, lambda driver: [driver.pid or 0]),
    "the run is told to end": kills(signal.SIGTERM, lambda driver: [driver.pid or 0]),
    "the run is interrupted": kills(signal.SIGINT, lambda driver: [driver.pid or 0]),
    "a worker or a method's process is killed": kills(signal.SIGKILL, others),
    "a worker or a method's process aborts": kills(signal.SIGABRT, others),
    "a call of a method is stopped": kills(signal.SIGSTOP, called),
    "a file of the results is damaged": damaged,
    "files have a largest size": limits(resource.RLIMIT_FSIZE, 200, 300_000),
    "few files may be open": limits(resource.RLIMIT_NOFILE, 12, 80),
    "memory is short": limits(resource.RLIMIT_DATA, 50 * 2**20, 2**31),
    "the disk is full": full_disk,
    "two runs at once": two_runs,
    "the Dask scheduler is killed": dask(0),
    "a Dask worker is killed": dask(1),
}


def device(kind: str, least: int, most: int) -> Callable[..., Told]:
    """A fault: from a random moment on, a device fails so many times."""

    def fault(folder: Path, draw: random.Random, length: float) -> Told:
        planned = devices.Fault(kind, draw.randrange(devices.FRAMES), draw.randint(least, most))
        yield start(live, folder, "serial", None, False, planned)

    return fault


FAULTS_AT_CAPTURES: dict[str, Any] = {
    "the camera's process is killed at a capture": at_capture("kill"),
    "the method raises at a capture": at_capture("raise"),
    "the method's process is killed at a capture": at_capture("die"),
}
FAULTS_OF_DEVICES: dict[str, Any] = {
    "a frame does not come": device("late", 1, 6),
    "an old frame comes": device("old", 1, 6),
    "a frame of another size comes": device("small", 1, 6),
    "the panel does not answer": device("panel", 1, 6),
    "the camera vanishes": device("late", devices.FOREVER, devices.FOREVER),
    "the panel vanishes": device("panel", devices.FOREVER, devices.FOREVER),
    "the run on devices is killed": FAULTS["the run is killed"],
    "a file of the results on devices is damaged": damaged,
}
