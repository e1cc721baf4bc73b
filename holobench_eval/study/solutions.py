"""What methods made for the targets of a session: kept, since its photographs come later."""

from __future__ import annotations

import io
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING

import torch
from torch import Tensor

from ..core.io import write_atomically
from .artifacts import Artifact, read_tensors
from .cost import Cost

if TYPE_CHECKING:
    from .job import Job

FOLDER = "solutions"


@dataclass(frozen=True)
class Solution:
    """What a method made: the phase ``(C, H, W)`` [rad], the captures and the effort it took, why the display ended it
    (empty: it did not), and what it had learned."""

    phase: Tensor
    captures: int
    taken: Cost
    stopped: str
    learned: Artifact | None


def kept(job: Job, make: Callable[[], Solution]) -> Solution:
    """The solution of a task, made once; kept in the output folder by the name of the task's first cell."""
    path = job.setting.output / FOLDER / f"{job.task.cells[0].id}.pt"
    if path.is_file():
        known = read_tensors(path)
        learned = job.learned(job.task.preparation)
        return Solution(known["phase"], known["captures"], Cost(**known["taken"]), known["stopped"], learned)
    made, buffer = make(), io.BytesIO()
    plain = {"captures": made.captures, "taken": asdict(made.taken), "stopped": made.stopped}
    torch.save({"phase": made.phase, **plain}, buffer)
    write_atomically(path, buffer.getvalue())
    return made
