"""What was run, on what, and when. Times of day are only here, never in a table."""

from __future__ import annotations

import hashlib
import json
import os
import platform
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any

from ...core.errors import UserError
from ...core.installed import __version__, installed
from ...core.io import now, read_text, write_atomically
from .. import isolation
from ..changes import noted
from ..cost import cpu_model
from ..definition import Study
from ..plan import Plan
from ..versions import HARNESS

PACKAGES = ("torch", "numpy", "scipy", "opencv-python-headless", "scikit-image", "kornia", "torchmetrics")
FILE = "provenance.json"
MOST_BYTES = 2_000_000


def text_digest(text: str) -> str:
    """sha256 of a config's text."""
    return hashlib.sha256(text.encode()).hexdigest()


def describe(
    study: Study, plan: Plan, output: Path, threads: int, workers: int, device: str = "cpu", gpu: str = ""
) -> dict[str, Any]:
    """Everything about the present run that is not in its config: versions, revision, machine, displays, command.

    device: as requested; gpu: its name, empty for a CPU or an unknown GPU. load: processes that wanted a core in the
    minute before, on average.
    """
    return {
        **revision(),
        "command": shlex.join([Path(sys.argv[0]).name, *sys.argv[1:]]),
        **noted(study.changes),
        **_basis(study, plan, output),
        **software(),
        "cpu": cpu_model(),
        "device": device,
        **({"gpu": gpu} if gpu else {}),
        "threads": threads,
        "workers": workers,
        **({"load": round(os.getloadavg()[0], 2)} if hasattr(os, "getloadavg") else {}),  # not on Windows
        **isolation.measured((entry.name for entry in study.methods), study.folder),
    }


def software() -> dict[str, Any]:
    """What runs, and the time at which it starts; ``end`` notes when it ends."""
    return {
        "package": __version__,
        "python": platform.python_version(),
        "packages": {name: installed(name) for name in PACKAGES},
        "platform": f"{platform.system()} {platform.release()} {platform.machine()}",
        "started": now(),
        "ended": None,
    }


def revision() -> dict[str, Any]:
    """The git revision of the package and whether its files were changed since; nothing outside a checkout."""
    try:
        _git("ls-files", "--error-unmatch", Path(__file__).name)
        changed = _git("status", "--porcelain", "--untracked-files=no")
        return {"revision": _git("rev-parse", "HEAD"), "dirty": bool(changed)}
    except (OSError, subprocess.SubprocessError):
        return {"revision": None, "dirty": None}


def _git(*arguments: str) -> str:
    command = ["git", "--no-optional-locks", *arguments]  # a killed run would leave its lock in the user's repository
    done = subprocess.run(command, cwd=Path(__file__).parent, capture_output=True, text=True, timeout=20, check=True)
    return done.stdout.strip()


def begin(output: Path, provenance: dict[str, Any], resumed: bool) -> dict[str, Any]:
    """Write ``provenance.json`` at the start of a run, with the runs that it resumes under ``earlier``.

    Written first, so that a killed run leaves its provenance beside its records.
    """
    before = read(output) if resumed else {}
    earlier = [*before.pop("earlier", []), before] if before else []
    return _write(output, {**provenance, "earlier": earlier})


def end(output: Path, provenance: dict[str, Any]) -> dict[str, Any]:
    """Note the end of the run."""
    return _write(output, {**provenance, "ended": now()})


def restate(output: Path, study: Study, plan: Plan, as_scored: bool = False) -> dict[str, Any]:
    """Note the text of the config that a report is written from again, and what its cells were computed with, beside
    the provenance of the runs; all cells of the plan have a record.

    as_scored: whether the scores are those of then, of whatever versions, as a committed records.csv has them.
    """
    known = read(output)
    scores = {"scores": known["scores"]} if as_scored and "scores" in known else {}
    return _write(output, {**known, **_basis(study, plan, output), **scores}) if known else known


def _basis(study: Study, plan: Plan, output: Path) -> dict[str, Any]:
    """The config, and what the names of its captures and scores depend on: the harness, the displays, the metrics."""
    displays = {display.name: display for task in plan.tasks for display in task.conditions}
    profiles = {name: {"version": display.version, "sha256": display.digest} for name, display in displays.items()}
    kind = "real" if study.display.real else "learned" if study.display.learned else "simulated"
    return {
        "config": os.path.relpath(study.config, output),
        "config_sha256": text_digest(study.text),
        "board": study.board,
        "harness": HARNESS,
        "scores": dict(plan.metrics),
        "profiles": profiles,
        "displays": dict.fromkeys(displays, kind),
    }


def _write(output: Path, provenance: dict[str, Any]) -> dict[str, Any]:
    write_atomically(output / FILE, f"{json.dumps(provenance, indent=1)}\n".encode())
    return provenance


def read(output: Path) -> dict[str, Any]:
    """The provenance of an output folder, empty if there is none yet."""
    try:
        content = json.loads(read_text(output / FILE, MOST_BYTES))
    except FileNotFoundError:
        return {}
    except (ValueError, RecursionError) as error:
        raise UserError(f"{output / FILE}: not JSON ({error}); delete the file and run the study again") from error
    earlier = content.get("earlier", []) if isinstance(content, dict) else None
    if not isinstance(earlier, list) or not all(isinstance(run, dict) for run in earlier):
        raise UserError(f"{output / FILE}: not the provenance of a run; delete the file and run the study again")
    return content
