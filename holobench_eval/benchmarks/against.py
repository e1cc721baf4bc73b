"""Is this version slower than another? Both take turns in one run, and intervals decide.

A machine's speed changes from minute to minute, and a process's from start to start (where its memory lies, say). So
each version has a process of its own, with the benchmarks of its own checkout, started anew several times; within a
start the two take turns at each case, and only ratios of neighbours count. The interval is Student's, over the starts.
"""

from __future__ import annotations

import math
import shutil
import subprocess
import tomllib
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from random import Random
from statistics import mean
from tempfile import TemporaryDirectory
from typing import Literal

from scipy import stats

from ..core.errors import UserError
from ..core.seeds import seed
from .suite import CHECKOUT, Worker, in_turns, suite

STARTS = 8
FEWEST, MOST, SECONDS = 3, 41, 1.5  # turns of a case in one start, and how long they take
TURN_SECONDS, LONG = 0.03, 0.2  # the least length of a turn; a call that is not repeated within one
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
    "study | one cell: Wirtinger, 20 iterations, 118x118, three colours",
)

Verdict = Literal["slower", "faster", "unchanged", "not in both"]


@dataclass(frozen=True)
class Comparison:
    """Time of the working tree over that of the other version: ratio, and the ends of its interval."""

    case: str
    verdict: Verdict
    ratio: float = math.nan
    lower: float = math.nan
    upper: float = math.nan
    reason: str = ""


def against(revision: str, cases: Sequence[str], advance: Callable[[str, float, float], None]) -> list[Comparison]:
    """Compare the working tree with a git revision.

    Parameters
    ----------
    revision
        Whatever names a commit. UserError: nothing of that name.
    cases
        Names of benchmarks.
    advance
        Called before each case with its name, the cases of all starts that are done and their number.
    """
    suite()  # without a checkout there is nothing to lay out
    with TemporaryDirectory() as folder:
        here, there = Path(folder) / "here", Path(folder) / "there"
        _lay_out(CHECKOUT, here)
        _lay_out(_extract(revision, Path(folder) / "archive"), there)
        draw = Random(seed("order of turns"))
        ratios: dict[str, list[float]] = {case: [] for case in cases}
        faults: dict[str, str] = {}
        for start in range(STARTS):
            # The process that is started first is a few percent slower, so each version is first as often as the other.
            folders = (here, there) if start % 2 == 0 else (there, here)
            with ExitStack() as stack:
                layouts = draw.randrange(2**32)  # the same for both: what they place alike, they time alike
                workers = {place: stack.enter_context(worker(place, layouts)) for place in folders}
                for number, case in enumerate(cases):
                    advance(case, start * len(cases) + number, STARTS * len(cases))
                    try:
                        if case not in faults:
                            ratios[case].append(_ratio(case, workers[here], workers[there], draw))
                    except LookupError as error:
                        faults[case] = str(error.args[0])
                        if any(process.ended for process in workers.values()):
                            break  # the other cases go on with the next start
    return [
        judge(case, logarithms, len(cases))
        if case not in faults
        else Comparison(case, "not in both", reason=faults[case])
        for case, logarithms in ratios.items()
    ]


def worker(folder: Path, layouts: int = 0) -> Worker:
    """A process that times benchmarks, with the package and the benchmarks of a folder and no others.

    layouts: seed of where arrays lie in memory, which is drawn anew for each answer.
    """
    return Worker("--from", str(folder), str(layouts), cache=folder / "cache", benchmarks=folder / "benchmarks")


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


def _ratio(case: str, here: Worker, there: Worker, draw: Random) -> float:
    """Logarithm of the ratio of times, over turns of two processes. LookupError: one cannot do the case."""
    for process in (here, there):
        process.ask(case, 1)  # one after the other: two programs' threads on the same cores wait for each other
    longest = max(process.ask(case, 1)["seconds"] for process in (here, there))
    calls = 1 if longest > LONG else max(2, math.ceil(TURN_SECONDS / longest))
    versions = {True: partial(here.ask, case, calls), False: partial(there.ask, case, calls)}
    turns = in_turns(versions, draw, SECONDS, FEWEST, MOST)
    ratios = [math.log(turn[True]["seconds"] / turn[False]["seconds"]) for turn in turns]
    return float(stats.trim_mean(ratios, DISTURBED))


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
