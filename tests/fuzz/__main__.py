"""Fuzz what reads files from outside: ``python -m tests.fuzz --seconds 60 [TARGET...]``, with atheris.

Each target runs in a process of its own, guided by the coverage of the package, under a limit of 1 GiB and of ten
seconds an input. A table goes to ``build/fuzz/report.md``; an input that breaks a target is kept beside it.
"""

import argparse
import platform
import re
import subprocess
import sys
import tempfile
import time
from contextlib import suppress
from pathlib import Path

ROOT = Path(__file__).parents[2]
REPORT = ROOT / "build/fuzz"


def fuzz(name: str, corpus: Path, seconds: int) -> None:
    """Fuzz one target in this process; libFuzzer ends it."""
    import atheris

    with atheris.instrument_imports(include=["holobench_eval"]):
        from tests.fuzz.targets import REFUSALS, TARGETS

    target, folder = TARGETS[name], Path(tempfile.mkdtemp(dir="/dev/shm"))
    for number, content in enumerate(target.begin()):
        (corpus / f"begin-{number}").write_bytes(content)

    def once(content: bytes) -> None:
        with suppress(*REFUSALS):
            target.run(content, folder)

    options = [
        f"-max_total_time={seconds}",
        "-rss_limit_mb=1024",
        "-timeout=10",
        "-max_len=20000",
        "-print_final_stats=1",
    ]
    atheris.Setup([sys.argv[0], *options, f"-artifact_prefix={REPORT}/{name}-", str(corpus)], once)
    atheris.Fuzz()


def main() -> int:
    """Fuzz targets one after the other and write the report."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("targets", nargs="*")
    parser.add_argument("--seconds", type=int, default=60, help="for each target")
    parser.add_argument("--corpus", type=Path, default=None, help=argparse.SUPPRESS)  # of one target, in this process
    given = parser.parse_args()
    if given.corpus:
        fuzz(given.targets[0], given.corpus, given.seconds)
    from tests.fuzz.targets import TARGETS

    REPORT.mkdir(parents=True, exist_ok=True)
    rows, broken = [], 0
    for name in given.targets or TARGETS:
        with tempfile.TemporaryDirectory() as corpus:
            command = [sys.executable, "-m", "tests.fuzz", name, "--seconds", str(given.seconds), "--corpus", corpus]
            began = time.monotonic()
            done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, errors="replace", check=False)
            took = time.monotonic() - began
        said = done.stdout + done.stderr
        numbers = {key: int(value) for key, value in re.findall(r"stat::(\w+):\s+(\d+)", said)}
        covered = re.findall(r"cov: (\d+)", said)
        broken += done.returncode != 0
        rows.append(
            f"| {name} | {numbers.get('number_of_executed_units', 0):,} | {numbers.get('new_units_added', 0)} "
            f"| {covered[-1] if covered else '–'} | {numbers.get('peak_rss_mb', 0)} | {took:.0f} "
            f"| {'none' if done.returncode == 0 else 'see the file beside'} |"
        )
        print(rows[-1], flush=True)
        if done.returncode:
            (REPORT / f"{name}.txt").write_text(said[-6000:])
    total = sum(int(row.split("|")[2].replace(",", "")) for row in rows)
    (REPORT / "report.md").write_text(
        f"""# Fuzzing

`python -m tests.fuzz --seconds {given.seconds}` with atheris (libFuzzer, guided by the coverage of the package), Python
{platform.python_version()}: **{total:,} executions over {len(rows)} targets, {broken} broken**. A target is broken by
anything but one line of refusal: another exception, an input that takes more than ten seconds, or more than 1 GiB of
memory. The valid inputs to begin with are in `tests/fuzz/targets.py`.

| target | executions | inputs with new coverage | coverage [edges] | peak memory [MiB] | time [s] | broken by |
|---|---:|---:|---:|---:|---:|---|
"""
        + "\n".join(rows)
        + "\n"
    )
    return int(broken > 0)


if __name__ == "__main__":
    sys.exit(main())
