"""Run a campaign of faults and write ``reports/faults/report.md``: ``python -m tests.faults --hours 0.25``."""

from __future__ import annotations

import argparse
import random
import shutil
import sys
import tempfile
import time
from pathlib import Path

from tests.faults.campaign import FAULTS, Count, study, without_fault

REPORT = Path(__file__).parents[2] / "reports/faults/report.md"
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
        wanted, length = without_fault(folder / "without")
        until = time.monotonic() + 3600 * given.hours
        while time.monotonic() < until:
            faults = [draw.choice(list(FAULTS)) for _ in range(FAULTS_A_STUDY)]
            study(folder / f"{seen.studies}", draw, faults, length, wanted, seen)
            shutil.rmtree(folder / f"{seen.studies - 1}", ignore_errors=True)
            print(f"{sum(seen.faults.values())} faults, {seen}", flush=True)
    REPORT.parent.mkdir(parents=True, exist_ok=True)
    REPORT.write_text(text(seen, len(wanted["records"]), given.seed, given.hours))
    return int(bool(seen.lost or seen.doubled or seen.wrong or seen.tables or seen.hung or seen.holes))


def text(seen: Count, cells: int, seed: int, hours: float) -> str:
    """The report."""
    rows = "\n".join(f"| {name} | {seen.faults.get(name, 0)} |" for name in FAULTS)
    return f"""# Faults

`python -m tests.faults --hours {hours:g} --seed {seed}`: **{sum(seen.faults.values())} faults in {seen.studies} studies
of {cells} cells: {seen.lost} cells lost, {seen.doubled} doubled, {seen.wrong} wrong; {seen.tables} tables differ,
{seen.hung} lives hung, {seen.holes} studies ended with a hole.** A study plans, trains a model of the display, solves
with methods of the package and with one of a user's file that photographs, scores, and writes its files of numbers. It
is hit {FAULTS_A_STUDY} times at moments drawn by the seed, each time followed by the same command, and then left in
peace once, with `--retry-failed`. Its records and its table are then compared, but for seconds and memory, with those
of a study that nothing happened to.

| fault | times |
|---|---:|
{rows}
"""


if __name__ == "__main__":
    sys.exit(main())
