"""Is this version slower than another? Both take turns in one run, and intervals decide.

A machine's speed changes from minute to minute, and a process's from start to start (where its memory lies, say). So
each version has a process of its own, with the benchmarks of its own checkout, started anew several times; within a
start the two take turns, and only ratios of neighbours count. The interval is Student's, over the starts.
"""

from __future__ import annotations

import json
import math
import random
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from statistics import mean
from tempfile import TemporaryDirectory
from typing import Literal

from scipy import stats

from ..core.errors import UserError
from ..core.seeds import seed
from .suite import CHECKOUT, suite

STARTS, TURNS = 12, 21
TURN_SECONDS = 0.05  # the least length of a turn
# Share of turns at either end that is left out. No median: where arrays lie makes two or three humps of one time.
DISTURBED = 0.1
CONFIDENCE = 0.99  # that no unchanged case at all is called changed
MARGIN = 1.05  # ratio of times below which a change is not worth a word
# What is compared unless one asks for something else: a bit of everything, none of it long.
COMPARED = (
    "gradient step, 540x960, 100 mm | holobench_eval",
    "propagation, 256x256, 20 mm | holobench_eval",
    "propagation, 540x960, 100 mm | holobench_eval",
    "approximator, preset small, 256x256, 100 mm | forward and backward",
    "study | one cell: Wirtinger, 100 iterations, 192x192, three colours",
)

Verdict = Literal["slower", "faster", "unchanged", "not in both"]
Worker = subprocess.Popen[str]


@dataclass(frozen=True)
class Comparison:
    """Time of the working tree over that of the other version: ratio, and the ends of its interval."""

    case: str
    verdict: Verdict
    ratio: float = math.nan
    lower: float = math.nan
    upper: float = math.nan
    reason: str = ""


def against(revision: str, cases: Sequence[str], advance: Callable[[str, int, int], None]) -> list[Comparison]:
    """Compare the working tree with a git revision.

    Parameters
    ----------
    revision
        Whatever names a commit. UserError: nothing of that name.
    cases
        Names of benchmarks.
    advance
        Called at each start of the two versions with the case, the starts done and their number.
    """
    suite()  # without a checkout there is nothing to lay out
    with TemporaryDirectory() as folder:
        here, there = Path(folder) / "here", Path(folder) / "there"
        _lay_out(CHECKOUT, here)
        _lay_out(_extract(revision, Path(folder) / "archive"), there)
        draw = random.Random(seed("order of turns"))
        ratios: dict[str, list[float]] = {case: [] for case in cases}
        faults: dict[str, str] = {}
        for start in range(STARTS):
            for number, case in enumerate(cases):
                advance(case, start * len(cases) + number, STARTS * len(cases))
                try:
                    if case not in faults:
                        ratios[case].append(_start(case, here, there, start % 2 == 0, draw))
                except LookupError as error:
                    faults[case] = str(error)
    return [
        Comparison(case, "not in both", reason=faults[case]) if case in faults else judge(case, logarithms, len(cases))
        for case, logarithms in ratios.items()
    ]


def judge(case: str, logarithms: Sequence[float], cases: int) -> Comparison:
    """The verdict on a case from the logarithms of its ratios, one a start; ``cases`` share the error (Bonferroni)."""
    interval = stats.ttest_1samp(logarithms, 0).confidence_interval(1 - (1 - CONFIDENCE) / cases)
    lower, ratio, upper = (math.exp(value) for value in (interval.low, mean(logarithms), interval.high))
    verdict: Verdict = "unchanged"
    if lower > 1 and ratio > MARGIN:
        verdict = "slower"
    elif upper < 1 and ratio < 1 / MARGIN:
        verdict = "faster"
    return Comparison(case, verdict, ratio, lower, upper)


def _start(case: str, here: Path, there: Path, here_first: bool, draw: random.Random) -> float:
    """Logarithm of the ratio of times, over turns of two fresh processes. LookupError: one cannot do the case.

    The process that is started first is a few percent slower, so each version should be first as often as the other.
    """
    folders = (here, there) if here_first else (there, here)
    with ExitStack() as stack:
        workers = {folder: stack.enter_context(worker(folder, draw.randrange(2**32))) for folder in folders}
        for process in workers.values():
            stack.callback(process.kill)
        calls = max(1, math.ceil(TURN_SECONDS / max(_timed(process, case, 1) for process in workers.values())))
        ratios = []
        for _ in range(TURNS):
            seconds = {folder: _timed(workers[folder], case, calls) for folder in draw.sample(folders, 2)}
            ratios.append(math.log(seconds[here] / seconds[there]))
    return float(stats.trim_mean(ratios, DISTURBED))


def worker(folder: Path, layouts: int = 0) -> Worker:
    """A process that times benchmarks on request, with the package and the benchmarks of a folder and no others.

    layouts: seed of where arrays lie in memory, which is drawn anew for each answer.
    """
    command = [sys.executable, str(folder / "benchmarks" / "worker.py"), "--from", str(folder), str(layouts)]
    pipe = subprocess.PIPE
    return subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=subprocess.DEVNULL, text=True)


def _timed(process: Worker, case: str, calls: int) -> float:
    assert process.stdin is not None
    assert process.stdout is not None
    process.stdin.write(f"{case}\t{calls}\n")
    process.stdin.flush()
    answer = json.loads(process.stdout.readline() or '{"error": "the process ended"}')
    if "seconds" not in answer:
        raise LookupError(answer["error"])
    return float(answer["seconds"])


def _extract(revision: str, folder: Path) -> Path:
    """The files of a git revision. UserError: there is none of that name, or no git checkout."""
    if not (CHECKOUT / ".git").exists():
        raise UserError(f"--against needs a git checkout, which {CHECKOUT} is not")
    # A revision may begin with a dash; what git archive is given is always a hash.
    done = _git("rev-parse", "--verify", "--quiet", "--end-of-options", revision)
    archive = folder.with_suffix(".tar")
    if done.returncode == 0:
        done = _git("archive", "--format=tar", f"--output={archive}", f"{done.stdout.strip()}^{{commit}}")
    if done.returncode:
        reason = done.stderr.strip()
        raise UserError(f"--against {revision}: no such commit" + (f"; git says: {reason}" if reason else ""))
    shutil.unpack_archive(archive, folder, filter="data")
    return folder


def _git(*arguments: str) -> subprocess.CompletedProcess[str]:
    command = ["git", *arguments]
    return subprocess.run(command, cwd=CHECKOUT, capture_output=True, text=True, errors="replace", check=False)


def _lay_out(checkout: Path, folder: Path) -> None:
    """Copy a checkout's packages to where they are imported from, as installing them would, and its benchmarks."""
    project = tomllib.loads((checkout / "pyproject.toml").read_text(encoding="utf-8"))
    sources = project["tool"]["setuptools"]["package-dir"]
    for package, source in sorted(sources.items()):  # outer ones first
        if not (checkout / source).is_dir():
            raise UserError(f"--against: that revision has no folder {source}, which its pyproject.toml names")
        ignored = shutil.ignore_patterns("__pycache__")
        shutil.copytree(checkout / source, folder / package.replace(".", "/"), ignore=ignored)
    benchmarks = checkout / "tests" / "benchmarks"  # a revision without any is timed by those of the working tree
    shutil.copytree(benchmarks if benchmarks.is_dir() else suite(), folder / "benchmarks")
