"""The benchmarks of a checkout, ``tests/benchmarks``: run by pytest-benchmark, or one at a time by their worker."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from ..core.errors import UserError

THREADS = 2
CHECKOUT = Path(__file__).parents[2]
INSTALL = "pip install -c constraints.txt -e '.[dev]' ('.[dev,peers]' to time others' code, too)"


@dataclass(frozen=True)
class Timing:
    """Seconds that one version takes for its group's work: median and quartiles over ``rounds`` calls.

    rows, columns: of its padded transforms; error: relative rms error of its field at the image plane; memory_bytes:
    the most that it held. None where there is none.
    """

    group: str
    version: str
    median_s: float
    lower_s: float
    upper_s: float
    rounds: int
    rows: int | None = None
    columns: int | None = None
    error: float | None = None
    memory_bytes: float | None = None


def suite() -> Path:
    """Folder of the benchmarks. UserError: the package does not lie in a checkout."""
    folder = CHECKOUT / "tests" / "benchmarks"
    if not (folder / "cases.py").is_file():
        raise UserError(f"no benchmarks in {folder}; in a checkout: {INSTALL}")
    return folder


def measure(only: str | None) -> tuple[list[Timing], bool]:
    """Time all benchmarks, or those whose names hold ``only``; pytest prints how far it is.

    Returns
    -------
    tuple of list and bool
        The timings, and whether all could be timed.

    Raises
    ------
    UserError
        None could be timed.
    """
    benchmarks = suite()
    if find_spec("pytest_benchmark") is None:
        raise UserError(f"pytest-benchmark is not installed; in the checkout: {INSTALL}")
    with TemporaryDirectory() as folder:
        results = Path(folder) / "results.json"
        command = [sys.executable, "-m", "pytest", str(benchmarks), "--benchmark-enable", "--benchmark-only", "-vv"]
        command += ["--benchmark-quiet", f"--benchmark-json={results}", "--no-header", "-p", "no:cacheprovider"]
        done = subprocess.run([*command, f"--only={only}"] if only else command, cwd=CHECKOUT, check=False)
        if done.returncode == 5:
            raise UserError(f"no benchmark's name holds '{only}'")
        rows = json.loads(results.read_text(encoding="utf-8"))["benchmarks"] if results.exists() else []
    if not rows:
        raise UserError(f"the benchmarks ended with {done.returncode}; what pytest printed says why")
    return [_timing(row["stats"], row["extra_info"]) for row in rows], done.returncode == 0


def _timing(stats: dict[str, Any], extra: dict[str, Any]) -> Timing:
    rows, columns = extra.get("padded") or (None, None)
    work = extra["group"], extra["version"]
    return Timing(*work, stats["median"], stats["q1"], stats["q3"], stats["rounds"], rows, columns, extra.get("error"))


def names(only: str) -> list[str]:
    """The benchmarks whose names hold a text. UserError: none does."""
    matching = [name for name in json.loads(_ask("--names").stdout) if only in name]
    if not matching:
        raise UserError(f"no benchmark's name holds '{only}'")
    return matching


def peak_memory(timing: Timing) -> float | None:
    """The most bytes that a version holds while it works, in a process of its own; None where it cannot be told."""
    done = _ask("--memory", f"{timing.group} | {timing.version}")
    return json.loads(done.stdout) if done.returncode == 0 else None


def _ask(*arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(suite() / "worker.py"), *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False)
