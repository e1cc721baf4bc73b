"""One life of a small study, in a process of its own that a fault may end."""

import math
import os
import re
import resource
import signal
import traceback
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any

from torch import Tensor

from holobench_eval.core.errors import UserError, out_of_memory
from holobench_eval.display import Capture
from holobench_eval.display.simulated.pipeline import BenchSession
from holobench_eval.lab.real import RealSession
from holobench_eval.methods.calibrated import patterns
from holobench_eval.methods.wirtinger import Wirtinger
from holobench_eval.report.facts import facts_of
from holobench_eval.report.results import Results, records_frame
from holobench_eval.study.config import load_study
from holobench_eval.study.executors import Executor, Serial
from holobench_eval.study.executors.clusters import Address
from holobench_eval.study.executors.local import Local
from holobench_eval.study.plan import plan
from holobench_eval.study.running import run as running
from holobench_eval.study.running.progress import Lines
from tests.faults import devices
from tests.faults.counts import note, taken
from tests.support import plugins
from tests.support.reports import write_texts

LONGEST = 300.0  # seconds that a life may take before it counts as hung
WORKERS = 2
REFUSED, TRACEBACK = 2, 3  # how a life ends that ends with a line, or with a traceback
SAID = "said.txt"  # what lives print
PLANNED = Path("planned")  # what the camera does at which capture, see `_counted`
TARGETS = ("astronaut", "coffee")
STEP, CAPTURES = running.step, {camera: camera.capture for camera in (BenchSession, RealSession)}

METHOD = plugins.text("hit")
STUDY = f"""title: faults
display: {{profiles: [green.yaml], panel: [128, 160]}}
targets: {{dataset: photographs, params: {{names: [{", ".join(TARGETS)}]}}}}
training: {{dataset: dead_leaves, params: {{count: 4}}, held_out: 1}}
protocol: {{metrics: [psnr]}}
limits: {{seconds: 20}}
methods:
  - double_phase
  - {{name: wirtinger, params: {{iterations: 5}}}}
  - {{name: "mine.py:mine", captures: 3}}
  - name: parametric_model
    params:
      patterns: 4
      start: {{iterations: 5}}
      training: {{rounds: 1, images: 2, steps: 3}}
      retrieval: {{iterations: 3}}
"""

SIMULATED = {"mine.py": METHOD, "green.yaml": devices.GREEN, "study.yaml": STUDY}
PHOTOGRAPHING = SIMULATED | {"study.yaml": re.sub(r"  - double_phase\n.*wirtinger.*\n", "", STUDY)}
DEVICES = {"mine.py": METHOD, **devices.FILES}


def executor(name: str) -> Executor:
    """One by one, on two workers of this machine, or on those of a Dask scheduler."""
    return {"serial": Serial(), "workers": Local(WORKERS)}.get(name) or Address(name)


def counting(job: running.Step) -> running.Result:
    """``run.step`` with cameras that count and dark patterns that are quickly solved, also in workers."""
    patterns.Wirtinger = partial(Wirtinger, iterations=5)  # type: ignore[misc, assignment]
    for camera, capture in CAPTURES.items():
        camera.capture = _counted(capture)  # type: ignore[attr-defined]
    return STEP(job)


def _counted(capture: Callable[[Any, Tensor], Capture]) -> Callable[[Any, Tensor], Capture]:
    """A camera that carries out what is planned for a capture once it has counted it: it kills its process, or gives a
    frame at which the method raises an error or ends its own process."""

    def counted(camera: Any, phase: Tensor) -> Capture:
        of, seen = note(camera.names), capture(camera, phase)
        planned = PLANNED / f"{of} {taken(Path(), of) if of else 0}"
        if not planned.exists():
            return seen
        kind = planned.read_text()
        planned.unlink()
        if kind == "kill":
            os.kill(os.getpid(), signal.SIGKILL)
        return replace(seen, frame=seen.frame * (math.nan if kind == "raise" else math.inf))

    return counted


def live(
    folder: Path,
    where: str = "serial",
    limits: dict[int, int] | None = None,
    peace: bool = False,
    fault: devices.Fault | None = None,
) -> None:
    """One life of a study: the run and its files of numbers. It ends with 0, with 1 for holes, with 2 for a refusal.

    where: see `executor`; peace: cells that failed are tried again; fault: of its devices.
    """
    os.chdir(folder)
    for output in (1, 2):
        os.dup2(os.open(SAID, os.O_WRONLY | os.O_CREAT | os.O_APPEND), output)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    for limit, value in (limits or {}).items():
        resource.setrlimit(limit, (value, value))
    if Path("bench.yaml").is_file():
        devices.failing(fault)
    running.step = counting
    try:
        study = load_study(Path("study.yaml"))
        planned, watch = plan(study), Lines(lambda _: None)
        chosen, artifacts = executor(where), Path("artifacts")
        outcome = running.run(study, planned, Path("out"), chosen, watch, 1, artifacts, retry_failed=peace)
        facts = facts_of(study)
        write_texts(Results(records_frame(outcome.records, facts), facts), Path("out"))
    except (UserError, OSError) as error:  # which the command says in one line
        print(error, flush=True)
        os._exit(REFUSED)
    except Exception as error:
        if out_of_memory(error):  # said in one line, too
            os._exit(REFUSED)
        traceback.print_exc()
        os._exit(TRACEBACK)
    os._exit(1 if outcome.failed else 0)


def begin(folder: Path, files: dict[str, str]) -> None:
    """A folder with the files of a study."""
    folder.mkdir(parents=True)
    for name, content in files.items():
        (folder / name).write_text(content)


def ends(process: BaseProcess) -> bool:
    """Wait for the end of a life; whether it came."""
    process.join(LONGEST)
    if process.is_alive():
        process.kill()
        process.join()
        return False
    return True


def on_devices(folder: Path) -> bool:
    """Whether a study photographs with devices, which are those of one process."""
    return (folder / "bench.yaml").is_file()
