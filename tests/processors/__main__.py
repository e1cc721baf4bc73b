"""Run tests on other processors: ``python -m tests.processors [--seeds 10] tests/golden tests/methods``.

Each argument runs on this processor and on ``--seeds`` others (see ``noise``), in a process each. What is printed: the
tests that fail there, and the comparisons whose room for noise is less than three times what noise takes of it. Results
lie in ``--folder``; what is there is not run again.
"""

import argparse
import json
import os
import re
import subprocess
import sys
from collections import defaultdict
from pathlib import Path

from tests.processors.margins import FILE
from tests.processors.noise import NUMBER, ULPS

ROOT = Path(__file__).parents[2]
MARGIN = 3


def run(tests: str, number: int, ulps: float, file: Path) -> None:
    """Run tests on a processor; 0 is this one."""
    if file.exists():
        return
    partly = file.with_suffix(".part")
    # Assertions are rewritten to tell what they compared; they are kept apart from those of other runs.
    environment = os.environ | {FILE: str(partly), "PYTHONPYCACHEPREFIX": str(file.parent / "compiled")}
    plugins = ["-p", "tests.processors.margins"]
    if number:
        # The process that others are forked from finds the noise by its name.
        environment |= {NUMBER: str(number), ULPS: str(ulps), "PYTHONPATH": str(ROOT)}
        plugins += ["-p", "tests.processors.noise"]
    command = [sys.executable, "-m", "pytest", "-n0", "-q", "--tb=short", "-p", "no:cacheprovider", *plugins]
    settings = "enable_assertion_pass_hook=true", "timeout=0", "faulthandler_timeout=0"
    command += [*(part for setting in settings for part in ("-o", setting)), *tests.split()]
    with file.with_suffix(".log").open("w") as log:
        subprocess.run(command, cwd=ROOT, env=environment, stdout=log, stderr=log, check=False)
    partly.rename(file)


def told(runs: list[Path]) -> list[str]:
    """What is wrong on the processors of some runs, the first of which is this one."""
    room, failed = defaultdict[tuple[str, str], dict[int, float]](dict), defaultdict[str, list[str]](list)
    for number, file in enumerate(runs):
        for test, what, value in map(json.loads, file.read_text(encoding="utf-8").splitlines()):
            if what == "failed":
                failed[test].append(str(number))
            elif isinstance(value, float):
                room[test, what][number] = value
    lines = [f"{test}: failed on {', '.join(where)}" for test, where in failed.items()]
    for (test, what), values in room.items():
        if (here := values.pop(0, None)) is None or not values:
            continue
        moved = max(abs(here - value) for value in values.values())
        if moved * MARGIN > abs(here):  # below zero in what is asserted not to hold
            lines.append(f"{test}: {what}: room {here:.3g}, of which noise takes {moved:.3g}")
    return lines


def main() -> int:
    """Run what is not there, and tell; 1 where something is wrong."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("tests", nargs="*", default=["tests/golden"], help="each an argument of pytest, or several")
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--ulps", type=float, default=1.0)
    parser.add_argument("--folder", type=Path, default=ROOT / "build/processors")
    given = parser.parse_args()
    given.folder.mkdir(parents=True, exist_ok=True)
    wrong = 0
    for tests in given.tests:
        name = re.sub(r"\W+", "-", tests).strip("-")
        files = [given.folder.resolve() / f"{name}.{number}.jsonl" for number in range(given.seeds + 1)]
        for number, file in enumerate(files):
            run(tests, number, given.ulps, file)
        lines = told(files)
        wrong += len(lines)
        print("\n".join([f"{tests}: {len(lines)} on {given.seeds} processors", *lines]), flush=True)
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
