"""Run the benchmarks of a checkout and read what they measured."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory

from ..core.errors import UserError

THREADS = 2
CHECKOUT = Path(__file__).parents[2]
INSTALL = "pip install -c constraints.txt -e '.[dev]' ('.[dev,peers]' to time others' code, too)"


@dataclass(frozen=True)
class Timing:
    """Seconds of one version of one group's work: median and quartiles over ``rounds`` calls.

    padded: (rows, columns) of its transforms; error: relative rms error of its field at the image plane;
    memory: the most bytes it held. None where there is none.
    """

    group: str
    version: str
    median: float
    lower: float
    upper: float
    rounds: int
    padded: tuple[int, int] | None = None
    error: float | None = None
    memory: float | None = None


def suite() -> Path:
    """Folder of the benchmarks. UserError: the package does not lie in a checkout."""
    folder = CHECKOUT / "tests" / "benchmarks"
    if not (folder / "cases.py").is_file():
        raise UserError(f"no benchmarks in {folder}; in a checkout: {INSTALL}")
    return folder


def measure(only: str | None) -> tuple[list[Timing], bool]:
    """Time all benchmarks, or those whose names hold ``only``; pytest tells how far it is on standard output.

    Also whether all could be timed. UserError: none could.
    """
    benchmarks = suite()
    if find_spec("pytest_benchmark") is None:
        raise UserError(f"pytest-benchmark is not installed; in the checkout: {INSTALL}")
    with TemporaryDirectory() as folder:
        found = Path(folder) / "found.json"
        command = [sys.executable, "-m", "pytest", str(benchmarks), "--benchmark-enable", "--benchmark-only", "-vv"]
        command += ["--benchmark-quiet", f"--benchmark-json={found}", "--no-header", "-p", "no:cacheprovider"]
        if only:
            command += [f"--only={only}"]
        done = subprocess.run(command, cwd=CHECKOUT, check=False)
        if done.returncode == 5:
            raise UserError(f"no benchmark's name holds '{only}'")
        rows = json.loads(found.read_text(encoding="utf-8"))["benchmarks"] if found.exists() else []
    if not rows:
        raise UserError(f"the benchmarks ended with {done.returncode}; what pytest printed says why")
    return [_timing(one) for one in rows], done.returncode == 0


def _timing(found: dict[str, object]) -> Timing:
    stats, extra = found["stats"], found["extra_info"]
    assert isinstance(stats, dict)
    assert isinstance(extra, dict)
    padded = extra.get("padded")
    return Timing(
        group=str(extra["group"]),
        version=str(extra["version"]),
        median=float(stats["median"]),
        lower=float(stats["q1"]),
        upper=float(stats["q3"]),
        rounds=int(stats["rounds"]),
        padded=(int(padded[0]), int(padded[1])) if padded else None,
        error=float(extra["error"]) if "error" in extra else None,
    )


def names(only: str) -> list[str]:
    """The benchmarks whose names hold a text. UserError: none does."""
    done = subprocess.run([sys.executable, str(suite() / "worker.py"), "--names"], capture_output=True, check=True)
    found = [name for name in json.loads(done.stdout) if only in name]
    if not found:
        raise UserError(f"no benchmark's name holds '{only}'")
    return found


def peak_memory(timing: Timing) -> float | None:
    """The most bytes that a version holds while it works, in a process of its own; None where it cannot be told."""
    name = f"{timing.group} | {timing.version}"
    done = subprocess.run(
        [sys.executable, str(suite() / "worker.py"), "--memory", name], capture_output=True, text=True, check=False
    )
    return json.loads(done.stdout) if done.returncode == 0 else None


def worker(place: Path, layouts: int = 0) -> subprocess.Popen[str]:
    """A process that times benchmarks on request, with the package from the folder ``place`` and nowhere else.

    layouts: seed of where arrays lie in memory, which is drawn anew for each answer.
    """
    return subprocess.Popen(
        [sys.executable, str(suite() / "worker.py"), "--from", str(place), str(layouts)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    )
