"""Can the tests fail? ``python -m tests.mutants [--module FILE] [--most 12] [--seed 0] [--again]``.

Changes the code of optics, metrics, imaging and the store in one place at a time and runs the tests that mirror the
module. Results are kept in ``reports/mutants/results.json`` and told in ``report.md``; the reason why a mutant may
survive stands under its name in ``reasons.yaml``. ``--again`` puts those that survived to the tests once more.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import sys
import tempfile
from functools import partial
from itertools import groupby
from pathlib import Path
from typing import Any

import yaml

from .kill import ROOT, apart, cold, preload, warm
from .mutate import Mutant, mutants

FOLDER = ROOT / "reports/mutants"
RESULTS = FOLDER / "results.json"
TESTS = {
    "optics": ["tests/optics", "tests/display/simulated/test_fused_path.py"],  # the grids of `transfer` are there
    "metrics": ["tests/metrics"],
    "imaging": ["tests/imaging"],
    "study": ["tests/study/test_store.py"],
}


def modules() -> list[str]:
    """Files that are mutated. Those of ``optics/kernel`` are compiled by Numba and are not."""
    found = [sorted((ROOT / "holobench_eval" / room).glob("[!_]*.py")) for room in ("optics", "metrics", "imaging")]
    return [*(str(file.relative_to(ROOT)) for room in found for file in room), "holobench_eval/study/store.py"]


def main() -> int:
    """Put a sample of each module to the tests and write the report."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--module", action="append", choices=modules(), metavar="FILE")
    parser.add_argument("--most", type=int, default=12, help="mutants of a module, drawn by the seed")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--seconds", type=float, default=60, help="of tests for a mutant, the quickest first")
    parser.add_argument("--again", action="store_true", help="only mutants that survived last time")
    given = parser.parse_args()
    os.chdir(ROOT)
    preload()
    known: dict[str, Any] = json.loads(RESULTS.read_text()) if RESULTS.exists() else {}
    asked = [name for name in modules() if name in (given.module or modules()) and (name in known or not given.again)]
    for room, names in groupby(asked, key=lambda name: name.split("/")[1]):
        drawn = [(name, mutant) for name in names for mutant in _drawn(name, given, known)]
        for (name, mutant), verdict in zip(drawn, _verdicts(room, drawn, given.seconds), strict=True):
            if verdict == "survived":
                known[name]["survivors"].append(mutant.name)
            else:
                known[name][verdict] += 1
        for row in known.values():
            row.setdefault("at first", len(row["survivors"]))
        RESULTS.write_text(json.dumps(known, indent=1, sort_keys=True, ensure_ascii=False) + "\n")
    (FOLDER / "report.md").write_text(text(known, yaml.safe_load((FOLDER / "reasons.yaml").read_text()) or {}))
    return 0


def _drawn(name: str, given: argparse.Namespace, known: dict[str, Any]) -> list[Mutant]:
    """The mutants of a module that are put to the tests; their row of results is begun anew."""
    before = known[name] if given.again else {"most": given.most, "seed": given.seed}
    most, seed = before["most"], before["seed"]

    def sample(count: int) -> list[int]:
        return sorted(random.Random(f"{seed}:{name}").sample(range(count), min(most, count)))

    count, made = mutants((ROOT / name).read_text(), str(ROOT / name), sample)
    drawn = [mutant for mutant in made if not given.again or mutant.name in before["survivors"]]
    fresh = {"mutants": count, "tested": len(drawn), "seed": seed, "most": most, "killed": 0, "timed out": 0}
    known[name] = {**(before if given.again else fresh), "survivors": []}
    return drawn


def _verdicts(room: str, drawn: list[tuple[str, Mutant]], seconds: float) -> list[str]:
    """``killed``, ``survived`` or ``timed out`` for each mutant of modules whose tests are in one folder."""
    names = dict.fromkeys(name.removesuffix(".py").replace("/", ".") for name, _ in drawn if room != "study")
    examples = [f"tests/test_docstrings.py::test_examples_run[{name}]" for name in names]
    found = warm([*TESTS[room], *examples], [(ROOT / name, mutant) for name, mutant in drawn], seconds) if drawn else []
    verdicts, tried = [], False
    for (name, mutant), (verdict, tests) in zip(drawn, found, strict=True):
        if verdict == "cold":
            unchanged = compile((ROOT / name).read_bytes(), ROOT / name, "exec", dont_inherit=True)
            if not tried and apart(partial(cold, ROOT / name, unchanged, tests)) != "survived":
                sys.exit(f"{name}: its tests do not pass without a mutant in a process that imports the package anew")
            tried = True
            verdict = apart(partial(cold, ROOT / name, mutant.code, tests))
            print(f"{verdict:9} {Path(name).stem} {mutant.name}", flush=True)
        verdicts.append(verdict)
    return verdicts


def text(known: dict[str, Any], reasons: dict[str, dict[str, str]]) -> str:
    """The report."""
    rows, survivors = [], []
    for name in (name for name in modules() if name in known):
        row, short = known[name], name.removeprefix("holobench_eval/")
        lived, tested = len(row["survivors"]), row["tested"]
        numbers = (row["mutants"], tested, row["killed"], row["timed out"], row["at first"], lived)
        rows.append(f"| {short} | {' | '.join(map(str, numbers))} | {100 * (tested - lived) / max(1, tested):.0f} % |")
        survivors += [f"\n### {short}\n"] if lived else []
        why = reasons.get(name, {})
        survivors += [f"- {mutant}  \n  {why.get(mutant, 'No reason is known.')}" for mutant in row["survivors"]]
    tested, first = (sum(row[key] for row in known.values()) for key in ("tested", "at first"))
    lived = sum(len(row["survivors"]) for row in known.values())
    most, seeds = (" or ".join(map(str, sorted({row[key] for row in known.values()}))) for key in ("most", "seed"))
    now, then = (f"{100 * (tested - left) / max(1, tested):.1f} %" for left in (lived, first))
    return f"""# Mutants

`python -m tests.mutants`: **{tested - lived:,} of {tested:,} mutants of {len(known)} modules are killed, {now};
when they were drawn, {then}.** In a mutant one operator, constant, condition, statement or returned value of the
code is another. It is killed where a test of the folder that mirrors its module fails, or the example in its
docstring. A test that takes four times as long as without the mutant, and ten seconds more, fails. Of each module
at most {most} mutants are drawn, by the seed {seeds}. Tests were then written against some that survived, so that of
the mutants that were not drawn the second share says more than the first.

Not mutated: docstrings, texts of errors, annotations, decorators, `__repr__`, and what Numba compiles.

| module | mutants | drawn | killed | timed out | survived when drawn | survive | killed |
|---|---:|---:|---:|---:|---:|---:|---:|
""" + "\n".join([*rows, "\n## Survivors", *survivors, ""])


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as scratch:
        os.environ["PYTEST_DEBUG_TEMPROOT"] = scratch
        sys.exit(main())
