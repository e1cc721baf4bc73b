"""Run the campaigns of faults and write ``build/faults/report.md``: ``python -m tests.faults --hours 0.25``."""

import argparse
import random
import shutil
import sys
import tempfile
import time
from pathlib import Path

from tests.faults.campaign import KINDS, Count, study, without_fault

REPORT = Path(__file__).parents[2] / "build/faults/report.md"
FAULTS_A_STUDY = 6


def main() -> int:
    """Count until the time is over."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--hours", type=float, default=0.25)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    draw, seen = random.Random(given.seed), Count()
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        wanted = [without_fault(kind, folder / f"without-{number}") for number, kind in enumerate(KINDS)]
        until = time.monotonic() + 3600 * given.hours
        while time.monotonic() < until:
            whole = wanted[seen.studies % len(wanted)]
            faults = [draw.choice(list(whole.kind.faults)) for _ in range(FAULTS_A_STUDY)]
            study(folder / f"{seen.studies}", draw, faults, whole, seen)
            shutil.rmtree(folder / f"{seen.studies - 1}", ignore_errors=True)
            print(f"{sum(seen.faults.values())} faults, {seen}", flush=True)
    REPORT.parent.mkdir(parents=True, exist_ok=True)
    REPORT.write_text(text(seen, [len(whole.records) for whole in wanted], given.seed, given.hours))
    faulty = seen.lost or seen.doubled or seen.wrong or seen.tables or seen.hung or seen.holes or seen.tracebacks
    return int(bool(faulty or seen.miscounted))


def text(seen: Count, cells: list[int], seed: int, hours: float) -> str:
    """The report."""
    rows = "\n".join(f"| {name} | {seen.faults.get(name, 0)} |" for kind in KINDS for name in kind.faults)
    told = "\n".join(["", "Lives that ended wrongly:", "", *(f"- `{line}`" for line in seen.told), ""])
    return f"""# Faults

`python -m tests.faults --hours {hours:g} --seed {seed}`: **{sum(seen.faults.values())} faults in {seen.studies} studies
of {" or ".join(map(str, cells))} cells: {seen.lost} cells lost, {seen.doubled} doubled, {seen.wrong} wrong;
{seen.tables} tables differ, {seen.hung} lives hung, {seen.tracebacks} ended with a traceback,
{seen.holes} studies ended with a hole.**

A study plans, trains a model of the display, solves with methods of the package and with one of a user's file that
photographs, scores, and writes its files of numbers. Every third study runs on a panel and a camera, which are
simulated behind their drivers, and trains nothing. A study is hit {FAULTS_A_STUDY} times at moments drawn by the seed,
each time followed by the same command, and then left in peace once, with `--retry-failed`. Its records and its table
are then compared, but for seconds and memory, with those of a study that nothing happened to. Before each fault half of
the records are taken away, so that there is something to hit; a fault that met no life, and a limit that none reached,
are not counted ({seen.late} more). The program asks the clock of the day for nothing but the dates in its files; so no
fault sets it.

Captures are compared with the count of the camera: {seen.miscounted} of {seen.counted} numbers are wrong. A capture is
counted before it is taken; {seen.surplus} were counted and not taken, since the fault came between. Faults at a capture
are carried out by the camera itself, and leave no such difference.

| fault | times |
|---|---:|
{rows}
{told if seen.told else ""}"""


if __name__ == "__main__":
    sys.exit(main())
