"""A study without physics: a display, scores and plug-ins that cost nothing, for tests of the machinery alone."""

from __future__ import annotations

import math
import os
import time
import types
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, cast

import pytest
import torch
from torch import Tensor

from holobench_eval.core.seeds import generator
from holobench_eval.display import CalibratedBench, MeteredDisplay, load_profile
from holobench_eval.display.api import Capture
from holobench_eval.study import opening
from holobench_eval.study.scoring import reference, scores
from holobench_eval.study.scoring.cell import work
from holobench_eval.study.scoring.job import Job
from holobench_eval.study.store import Record

PLUGINS = Path(__file__).with_name("fake_plugins.py").read_text()
CONFIG = """\
title: "Fake"
seed: 3
display: {{profiles: [{profiles}], panel: [128, 160]}}
targets: {{dataset: "plugins.py:Gray", params: {{count: {count}}}}}
methods:
{methods}
"""


def write_config(
    folder: Path,
    methods: tuple[str, ...] = ("plugins.py:Toy",),
    count: int = 3,
    profiles: str = "ideal",
    inside: bool = False,
) -> Path:
    """A config and the plug-ins it names, in a folder. inside: methods have no process of their own."""
    (folder / "plugins.py").write_text(PLUGINS)
    path = folder / "study.yaml"
    entries = "\n".join(f"  - {method}" for method in methods)
    text = CONFIG.format(methods=entries, count=count, profiles=profiles)
    inside = inside or any("Following" in method for method in methods)  # which is privileged
    path.write_text(f"{text}isolation: none\n" if inside else text)
    return path


write_inside = partial(write_config, inside=True)


@contextmanager
def held(folder: Path, index: int) -> Iterator[None]:
    """Within the context, `Toy` does not come to an end with the target of this index."""
    target = f"{(1 + index) / 10:.1f}"
    with (folder / "solves.txt").open("a", buffering=1) as log:
        log.write(f"hold {target}\n")
        yield
        log.write(f"free {target}\n")


def solves(folder: Path) -> list[str]:
    """A line for every solution that a fake method made."""
    log = folder / "solves.txt"
    lines = log.read_text().splitlines() if log.exists() else []
    return [line for line in lines if not line.startswith(("hold", "free"))]


class FakeBench:
    """A display whose picture is the target, darkened by the phase."""

    def __init__(self, spec: Any) -> None:
        self.spec, self.bench = spec, self

    def for_method(
        self, method: Any, label: str, target: Tensor, item: str, repeat: int, sha256: str = "", **given: Any
    ) -> MeteredDisplay:
        given |= {"target_name": item, "target_sha256": sha256}
        return MeteredDisplay(cast(CalibratedBench, self), label, target, (item, repeat), method, **given)

    def photograph(self, phase: Tensor, target: Tensor, **names: Any) -> Any:
        shade = 0.5 + phase.mean() / 100 + names["repeat"] / 1000
        image = target * shade * torch.linspace(0.5, 1, target.shape[-1])
        return types.SimpleNamespace(image=image, saturated=0.0, efficiency=0.5, residual=0.05)

    def exposure(self, target: Tensor) -> tuple[float, ...]:
        return (1.0,) * len(target)

    def session(self, *names: object, exposure: tuple[float, ...] = ()) -> FakeSession:
        return FakeSession(self.spec, tuple(name for name in names if not isinstance(name, Tensor)))

    def rectified(self, capture: Capture, target: Tensor) -> Tensor:
        return capture.frame


@dataclass(frozen=True)
class FakeSession:
    """A camera that sees noise around the mean of the phase."""

    spec: Any
    names: tuple[object, ...]

    def capture(self, phase: Tensor) -> Capture:
        noise = torch.rand((len(phase), *self.spec.region.shape), generator=generator(*self.names))
        frame = phase.mean((1, 2))[:, None, None] + noise
        return Capture(frame, dark=0.0, white=math.inf, gain=(1.0,) * len(frame))


def fake_display(place: Any, seed: int, device: torch.device | None = None) -> FakeBench:
    return FakeBench(load_profile("ideal").spec(place.spec.shape))


def fake_score(image: Tensor, target: Tensor, **_: Any) -> dict[str, float]:
    error = float((image - target).square().mean())
    return {"psnr_linear": -10 * float(torch.tensor(error + 1e-6).log10()), "ssim_linear": 1 - error}


FAKES: tuple[tuple[types.ModuleType, str, Any], ...] = (
    (opening, "open_display", fake_display),
    (scores, "score", fake_score),
    (reference, "digits", lambda display, seed: {}),
)
"""Where the machinery calls the physics, and what stands there instead."""


def install(put: Callable[[Any, str, Any], None] = setattr) -> None:
    """Put the fakes where a task calls the physics."""
    for module, name, fake in FAKES:
        put(module, name, fake)


@contextmanager
def installed() -> Iterator[None]:
    """The fakes are there within the context."""
    with pytest.MonkeyPatch.context() as patch:
        install(patch.setattr)
        yield


def fake_work(task: Job) -> list[Record]:
    """``scoring.cell.work`` with the fakes, for worker processes that are started fresh."""
    install()
    return work(task)


def lose_a_worker(task: Job) -> list[Record]:
    """Work that kills its process on one target."""
    if task.task.cells[0].target == "gray 1" and not task.task.is_floor:
        os.kill(os.getpid(), 9)
    return fake_work(task)


def noted_work(task: Job) -> list[Record]:
    """Work that writes when it began and ended into ``solves.txt`` of the output folder."""
    begun = time.time()
    records = fake_work(task)
    with (task.setting.output / "solves.txt").open("a") as log:
        log.write(f"task {begun} {time.time()}\n")
    return records


def untimed(records: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Records without what each run measures itself."""
    return [{**record, "seconds": None, "memory_mib": None, "cpu_s": None, "reused": False} for record in records]
