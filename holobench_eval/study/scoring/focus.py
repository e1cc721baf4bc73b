"""Focal stacks: the picture of every plane, photographed at its distance, scored where it is in focus (paper 7.1)."""

from __future__ import annotations

from typing import Any

import torch

from ...display import MeteredDisplay
from ...display.traits import traits_of
from ..focal_stacks import offset
from .job import Job, Measured
from .picture import captured
from .solution import solution


def focus(job: Job) -> Measured:
    """Solve for one plane, or for all planes of a scene at once, on the display before any change; the result shows the
    phase at any of the task's planes and displays."""
    cells, display = job.task.cells, job.task.conditions[0].nominal
    targets = {cell.target: job.target(cell, display) for cell in cells}
    offsets = {cell.target: offset(display, cell.change) for cell in cells}

    def solve(method: Any, handle: MeteredDisplay) -> Any:
        pictures = torch.stack(list(targets.values())).to(job.device)
        if traits_of(method).planes:
            return method.solve_planes(pictures, list(offsets.values()), handle)[None]
        return method.solve(pictures, handle)

    solved = solution(job, display, targets[cells[0].target], solve)
    return lambda cell, shown_on: captured(job, solved, cell, shown_on, targets[cell.target])
