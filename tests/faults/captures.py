"""Faults while captures are taken: after each recovery, what is reported is what the camera counted.

The camera is virtual and keeps a count of its own, a file for each target and one for the training. It carries out the
faults itself, so that each meets the capture that was drawn for it, however busy the machine is: it kills its process,
or gives a frame at which the method raises an error or ends its own process.
"""

from __future__ import annotations

import json
import math
import os
import random
import shutil
import signal
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from holobench_eval.display import load_profile
from holobench_eval.study import opening
from holobench_eval.study import run as running
from holobench_eval.study.config import load_study
from holobench_eval.study.executors import Serial
from holobench_eval.study.executors.local import Local
from holobench_eval.study.executors.processes import PRELOADED, start
from holobench_eval.study.plan import plan
from holobench_eval.study.progress import Lines
from tests.faults.counts import TRAINING, note, reported, taken
from tests.faults.life import SAID, ends
from tests.support import fake_trained
from tests.support.fake_study import FakeBench, FakeSession, install, write_config

FAULTS = Path("faults")  # what the camera will do at which capture
KINDS = {
    "the camera's process is killed": "kill",
    "the method raises": "raise",
    "the method's process is killed": "die",
}
TARGETS = 3
LIVES = 2  # of a study that faults hit, each until its command has ended by itself
ENDED = 3  # how a life ends that has written all records

METHODS = """
import os
from dataclasses import dataclass
from typing import ClassVar

import torch


def seen(frame):
    if frame.isnan().any():
        raise ValueError("a frame of nothing")
    if frame.isinf().any():
        os.kill(os.getpid(), 9)
    return frame.mean()


@dataclass(frozen=True)
class Solver:
    keeps: bool = False
    camera: ClassVar[bool] = True

    def solve(self, target, bench):
        phase = torch.zeros(*target.shape[:2], *bench.spec.shape)
        for _ in range(3):
            if self.keeps:
                bench.keep(phase[0])
            phase = phase + seen(bench.capture(phase[0]))
        return phase


@dataclass(frozen=True)
class Learner:
    trains: ClassVar[bool] = True
    version: ClassVar[int] = 1

    def prepare(self, bench):
        image = bench.images[0]
        phase = torch.zeros(len(image.target), *bench.spec.shape)

        def make(number):
            first, second = (seen(bench.photograph(phase, image, number, again)) for again in range(2))
            return {"mean": first + second}

        for number in range(3):
            bench.kept(f"round {number}", lambda: make(number))
            bench.log(round=number, step=0)
        return {}

    def solve(self, target, bench):
        return torch.zeros(*target.shape[:2], *bench.spec.shape)
"""

SOLVERS = ("params: {}", "captures: 2, params: {keeps: true}", "captures: 2")  # the last fails whenever it is tried
TRAININGS = ("", ", captures: 5")  # the last is not enough
ISOLATIONS = ("none", "files")


@dataclass
class Seen:
    """What a campaign has seen. faults: by name; compared: numbers of captures; wrong: those that were not the
    camera's, in words; budgets: study and name of the cells whose solution or training their budget has ended."""

    faults: dict[str, int] = field(default_factory=dict)
    studies: int = 0
    compared: int = 0
    budgets: set[tuple[int, str]] = field(default_factory=set)
    wrong: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class CountingSession(FakeSession):
    """A camera that counts, and does what is planned for a capture once it has counted it."""

    def capture(self, phase: Tensor) -> Tensor:
        """A frame, unless a fault is planned."""
        (names,) = self.names
        of = note(names)  # type: ignore[arg-type]
        planned, frame = FAULTS / f"{of} {taken(Path(), of)}", super().capture(phase)
        if not planned.exists():
            return frame
        kind = planned.read_text()
        planned.unlink()
        if kind == "kill":
            os.kill(os.getpid(), signal.SIGKILL)
        return frame * (math.nan if kind == "raise" else math.inf)


class CountingBench(FakeBench):
    """A display with that camera."""

    def session(self, *names: object, exposure: tuple[float, ...] = ()) -> FakeSession:
        """See ``FakeBench``."""
        session = super().session(*names)
        return CountingSession(session.spec, session.names)


def counting_display(place: Any, seed: int, device: torch.device | None = None) -> CountingBench:
    """In the place of ``opening.open_display``."""
    return CountingBench(load_profile("ideal").spec(place.spec.shape))


def counted_step(job: running.Step) -> running.Result:
    """``run.step`` with that display, also in workers."""
    install()
    opening.open_display = counting_display  # type: ignore[assignment]
    return STEP(job)


STEP = running.step


def live(folder: Path, workers: int, retry_failed: bool) -> None:
    """One life of a study, in a process of its own."""
    os.chdir(folder)
    for output in (1, 2):
        os.dup2(os.open(SAID, os.O_WRONLY | os.O_CREAT | os.O_APPEND), output)
    running.step = counted_step
    study, executor = load_study(Path("study.yaml")), Local(workers) if workers else Serial()
    watch = Lines(lambda _: None)
    running.run(study, plan(study), Path("out"), executor, watch, 1, Path("artifacts"), retry_failed=retry_failed)
    os._exit(ENDED)


def begin(folder: Path, solver: str, training: str, isolation: str) -> None:
    """A folder with the files of a study."""
    (folder / FAULTS).mkdir(parents=True)
    methods = (f'{{name: "methods.py:Solver", {solver}}}', '"methods.py:Learner"')
    config = write_config(folder, methods, TARGETS)
    images = f'{{dataset: "trained.py:Unseen", held_out: 1{training}}}'
    config.write_text(f"{config.read_text()}training: {images}\nisolation: {isolation}\n")
    (folder / "methods.py").write_text(METHODS)
    shutil.copy(fake_trained.__file__, folder / "trained.py")


def study(folder: Path, draw: random.Random, lives: int, seen: Seen, isolation: str) -> None:
    """Let a study live through faults, then once in peace."""
    if __name__ not in PRELOADED:
        PRELOADED.append(__name__)  # else every life would import all anew
    begin(folder, SOLVERS[seen.studies % len(SOLVERS)], TRAININGS[seen.studies % len(TRAININGS)], isolation)
    for number in range(lives + 1):
        if number < lives:
            plan_faults(folder, draw)
        workers, retry_failed = draw.choice((0, 2)), number == lives or draw.random() < 0.6
        while True:
            before = {path.name: path.read_text() for path in (folder / FAULTS).iterdir()}
            process = start(live, folder, workers, retry_failed)
            if not ends(process):
                raise RuntimeError(f"a life hangs: {(folder / SAID).read_text()[-500:]}")
            met = before.keys() - {path.name for path in (folder / FAULTS).iterdir()}
            for name, kind in KINDS.items():
                seen.faults[name] = seen.faults.get(name, 0) + sum(before[each] == kind for each in met)
            if process.exitcode == ENDED:
                break
            if not met:
                raise RuntimeError(f"a life ends with {process.exitcode}: {(folder / SAID).read_text()[-500:]}")
        compare(folder, seen)
    seen.studies += 1


def plan_faults(folder: Path, draw: random.Random) -> None:
    """Replace what was planned by faults at one of the next captures of most targets and of the training."""
    shutil.rmtree(folder / FAULTS)
    (folder / FAULTS).mkdir()
    for of in (TRAINING, *(f"gray {number}" for number in range(TARGETS))):
        if draw.random() < 0.8:
            planned = folder / FAULTS / f"{of} {taken(folder, of) + draw.randint(1, 3)}"
            planned.write_text(draw.choice(list(KINDS.values())))


def compare(folder: Path, seen: Seen) -> None:
    """Compare the captures in records and artifacts with those that the camera has counted."""
    captures = reported(folder, "Solver")
    for of, number in captures.items():
        seen.compared += 1
        if number != taken(folder, of):
            seen.wrong.append(f"{of}: {number} captures are reported, {taken(folder, of)} were taken")
    if len(captures) != TARGETS + 1:
        seen.wrong.append(f"captures of {', '.join(captures)} alone")
    for path in (folder / "out/records").glob("*.json"):
        record = json.loads(path.read_text())
        if "has used its" in record["reason"] + record["stopped"]:
            seen.budgets.add((seen.studies, path.stem))


def campaign(folder: Path, seed: int, faults: int, isolations: tuple[str, ...] = ISOLATIONS) -> Seen:
    """Studies with faults, until so many have hit one."""
    draw, seen = random.Random(seed), Seen()
    while sum(seen.faults.values()) < faults:
        study(folder / str(seen.studies), draw, LIVES, seen, isolations[seen.studies // 2 % len(isolations)])
        shutil.rmtree(folder / str(seen.studies - 1))
    return seen
