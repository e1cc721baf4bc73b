"""Is this version slower than another? Both take turns in one run, and intervals decide.

A machine's speed changes from minute to minute, and a process's from start to start (where its memory lies, say). So
each version has a process of its own, started anew several times; within a start the two take turns, and only ratios
of neighbours count. The interval is Student's, over the starts.
"""

from __future__ import annotations

import json
import math
import random
import shutil
import subprocess
import tarfile
import tomllib
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from statistics import mean, stdev
from tempfile import TemporaryDirectory
from typing import Literal

from scipy import stats

from ..core.errors import UserError
from ..core.seeds import seed
from .suite import CHECKOUT, suite, worker

STARTS, TURNS = 12, 21
TURN_SECONDS = 0.05
"""Least length of a turn."""
DISTURBED = 0.1
"""Share of turns at either end that is left out. No median: where arrays lie makes two or three humps of one time."""
CONFIDENCE = 0.99
"""That no unchanged case at all is called changed."""
MARGIN = 1.05
"""Ratio of times below which a change is not worth a word."""
COMPARED = (
    "gradient step, 540x960, 100 mm | holobench_eval",
    "propagation, 256x256, 20 mm | holobench_eval",
    "propagation, 540x960, 100 mm | holobench_eval",
    "approximator, preset small, 256x256, 100 mm | forward and backward",
    "study | one cell: Wirtinger, 100 iterations, 192x192, three colours",
)
"""What is compared unless one asks for something else: a bit of everything, none of it long."""

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


def against(revision: str, cases: Sequence[str], said: Callable[[str, int, int], None]) -> list[Comparison]:
    """Compare the working tree with a git revision; ``said`` is told of each start: case, and starts done of all."""
    suite()  # without a checkout there is nothing to lay out
    with TemporaryDirectory() as folder:
        here, there = Path(folder) / "here", Path(folder) / "there"
        _lay_out(CHECKOUT, here)
        _lay_out(_extract(revision, Path(folder) / "archive"), there)
        draw = random.Random(seed("order of turns"))
        found: dict[str, list[float]] = {case: [] for case in cases}
        faults: dict[str, str] = {}
        steps = [(start, case) for start in range(STARTS) for case in cases]
        for done, (start, case) in enumerate(steps):
            said(case, done, len(steps))
            if case in faults:
                continue
            try:
                found[case].append(_start(case, here, there, start % 2 == 0, draw))
            except LookupError as error:
                faults[case] = str(error)
    return [
        Comparison(case, "not in both", reason=faults[case]) if case in faults else judge(case, ratios, len(cases))
        for case, ratios in found.items()
    ]


def judge(case: str, logarithms: Sequence[float], cases: int) -> Comparison:
    """The verdict on a case from the logarithms of its ratios, one a start; ``cases`` share the error (Bonferroni)."""
    middle = mean(logarithms)
    tail = (1 - CONFIDENCE) / 2 / cases
    reach = float(stats.t.ppf(1 - tail, len(logarithms) - 1)) * stdev(logarithms) / math.sqrt(len(logarithms))
    lower, ratio, upper = (math.exp(value) for value in (middle - reach, middle, middle + reach))
    verdict: Verdict = "unchanged"
    if lower > 1 and ratio > MARGIN:
        verdict = "slower"
    elif upper < 1 and ratio < 1 / MARGIN:
        verdict = "faster"
    return Comparison(case, verdict, ratio, lower, upper)


def _start(case: str, here: Path, there: Path, here_first: bool, draw: random.Random) -> float:
    """Logarithm of the ratio of times, over turns of two fresh processes. LookupError: one cannot do the case.

    The process that is started first is a few percent slower, so it should be the one as often as the other.
    """
    places = (here, there) if here_first else (there, here)
    with ExitStack() as stack:
        workers = {place: stack.enter_context(worker(place, draw.randrange(2**32))) for place in places}
        for one in workers.values():
            stack.callback(one.kill)
        calls = max(1, math.ceil(TURN_SECONDS / max(_timed(one, case, 1) for one in workers.values())))
        ratios = []
        for _ in range(TURNS):
            seconds = {place: _timed(workers[place], case, calls) for place in draw.sample(places, 2)}
            ratios.append(math.log(seconds[here] / seconds[there]))
    return float(stats.trim_mean(ratios, DISTURBED))


def _timed(one: subprocess.Popen[str], case: str, calls: int) -> float:
    assert one.stdin is not None
    assert one.stdout is not None
    one.stdin.write(f"{case}\t{calls}\n")
    one.stdin.flush()
    line = one.stdout.readline()
    answer = json.loads(line) if line else {"error": "the process ended"}
    if "seconds" not in answer:
        raise LookupError(answer["error"])
    return float(answer["seconds"])


def _extract(revision: str, folder: Path) -> Path:
    """The files of a git revision. UserError: there is none of that name, or no git checkout."""
    if not (CHECKOUT / ".git").exists():
        raise UserError(f"--against needs a git checkout, which {CHECKOUT} is not")
    # A revision may begin with a dash; what git archive is given is always a hash.
    found = _git("rev-parse", "--verify", "--quiet", "--end-of-options", revision)
    if found.returncode == 0:
        found = _git("archive", "--format=tar", f"{found.stdout.decode().strip()}^{{commit}}")
    if found.returncode:
        said = found.stderr.decode(errors="replace").strip()
        raise UserError(f"--against {revision}: no such commit" + (f"; git says: {said}" if said else ""))
    with tarfile.open(fileobj=BytesIO(found.stdout)) as archive:
        archive.extractall(folder, filter="data")
    return folder


def _git(*arguments: str) -> subprocess.CompletedProcess[bytes]:
    return subprocess.run(["git", *arguments], cwd=CHECKOUT, capture_output=True, check=False)


def _lay_out(checkout: Path, folder: Path) -> None:
    """Copy a checkout's packages to where they are imported from, as installing them would."""
    project = tomllib.loads((checkout / "pyproject.toml").read_text(encoding="utf-8"))
    for package, source in sorted(project["tool"]["setuptools"]["package-dir"].items()):  # outer ones first
        place = folder / package.replace(".", "/")
        if not (checkout / source).is_dir():
            raise UserError(f"--against: that revision has no folder {source}, which its pyproject.toml names")
        shutil.copytree(checkout / source, place, ignore=shutil.ignore_patterns("__pycache__"))
