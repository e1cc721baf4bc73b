"""``holoeval score``: pictures that somebody photographed, scored against their targets without any fiducial."""

from __future__ import annotations

import platform
import shlex
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from .. import __version__
from ..core.errors import UserError, suggest
from ..core.installed import installed
from ..report import Description, Layout, Results, write_report
from ..report.data.text import FILES
from ..study import provenance
from ..study.folders.files import Folders, read_folders
from ..study.folders.scoring import CONDITION, Said, Scoring
from ..study.progress import SECONDS_BETWEEN_LINES
from ..study.store import Store
from ..study.versions import ALIGNMENT, HARNESS

VALUES = ("stored", "srgb", "linear")
"""How files are read: as they are; captures and targets as sRGB; captures as linear light and targets as sRGB."""


def score_folders(
    captures: Path,
    targets: Path,
    output: Path,
    values: str = "stored",
    baseline: str | None = None,
    lpips_weights: str | None = None,
    console: Console | None = None,
) -> tuple[Path, Results]:
    """Score ``captures/<method>/<target>.png`` against ``targets/<target>.png``: path and numbers of the report.

    values: see `VALUES`; baseline: the method that every other one is tested against. What was computed before in
    ``output`` for the same files by the same code is taken from there. UserError for input that cannot be used, in one
    line; a capture that cannot be aligned is a hole in the report, with its reason.
    """
    if values not in VALUES:
        raise UserError(f"--values {values}: {suggest(values, VALUES)}")
    _refuse_nested(output, captures, targets)
    folders = read_folders(captures, targets)
    if baseline is not None and baseline not in folders.methods:
        raise UserError(f"--baseline {baseline}: no such folder of captures; {suggest(baseline, folders.methods)}")
    lossy = next((picture.path for picture in folders.captures.values() if picture.is_jpeg), None)
    if values == "linear" and lossy is not None:
        raise UserError(f"{lossy}: a JPEG holds no linear light; expected --values stored or srgb")
    console = console or Console()
    for note in folders.notes:
        console.print(note, markup=False, highlight=False, soft_wrap=True)
    scoring = Scoring(folders, Store(output), values, lpips_weights)
    with scoring.store.locked():
        known = provenance.begin(output, _provenance(folders, values), resumed=True)
        with _steps(console, 2 * len(folders.captures) + len(folders.targets)) as step:
            records = [asdict(record) for record in scoring.records(step)]
        known = provenance.end(output, known)
        words = ["--captures", captures, "--targets", targets, "--output", output, "--values", values]
        words += ["--baseline", baseline] if baseline else []
        described = Description(command=shlex.join(["holoeval", "score", *map(str, words)]))
        return write_report(_layout(folders, scoring.domain, values, baseline), records, output, known, described)


def _layout(folders: Folders, domain: str, values: str, baseline: str | None) -> Layout:
    return Layout(
        title=f"Scores of photographs: {', '.join(folders.methods)}",
        pairs=tuple((method, CONDITION) for method in folders.methods),
        targets=tuple(folders.targets),
        headline=f"psnr_{domain}",
        baseline=baseline,
        note=" ".join(folders.notes),
        measure=FILES,
        values=values,
    )


def _provenance(folders: Folders, values: str) -> dict[str, Any]:
    files = {f"captures/{'/'.join(key)}": one.sha256 for key, one in folders.captures.items()}
    files |= {f"targets/{name}": one.sha256 for name, one in folders.targets.items()}
    return {
        "package": __version__,
        "code_sha256": {"metrics": HARNESS, "alignment": ALIGNMENT},
        "files": files,
        "values": values,
        "python": platform.python_version(),
        "packages": {name: installed(name) for name in provenance.PACKAGES},
        "platform": f"{platform.system()} {platform.release()} {platform.machine()}",
        "started": provenance.now(),
        "ended": None,
    }


def _refuse_nested(output: Path, *sources: Path) -> None:
    for source in sources:
        if output.resolve().is_relative_to(source.resolve()):
            raise UserError(
                f"--output {output}: lies in {source}, whose files it would mix with; expected another folder"
            )


@contextmanager
def _steps(console: Console, total: int) -> Iterator[Said]:
    """Tell every step by its name: a bar on a terminal, else a line every few seconds."""
    if console.is_terminal:
        columns = (
            TextColumn("{task.description}", markup=False),
            BarColumn(),
            MofNCompleteColumn(),
            TimeRemainingColumn(),
        )
        with Progress(*columns, console=console) as progress:
            bar = progress.add_task("reading", total=total, completed=-1)
            yield lambda name: progress.update(bar, description=name, advance=1)
        return
    state = {"last": time.monotonic(), "done": 0.0}

    def line(name: str) -> None:
        if time.monotonic() - state["last"] >= SECONDS_BETWEEN_LINES:
            state["last"] = time.monotonic()
            console.print(
                f"{state['done']:.0f}/{total} steps; now {name}", markup=False, highlight=False, soft_wrap=True
            )
        state["done"] += 1

    yield line
