"""Focal stacks and light fields: the picture of every plane, photographed at its distance, or of every view, through
the eye's pupil at its place (paper 7.1)."""

from __future__ import annotations

from typing import Any

import torch

from ...display import MeteredDisplay
from ...display.traits import traits_of
from ..stacks import at_once, where
from .job import Job, Measured
from .picture import captured
from .solution import solution


def focus(job: Job) -> Measured:
    """Solve for one plane or view, or for all of a scene at once, on the display before any change; the result shows
    the phase at any of the task's planes or places and displays."""
    cells, display = job.task.cells, job.task.conditions[0].nominal
    targets = {cell.target: job.target(cell, display) for cell in cells}
    places = {cell.target: where(display, cell.change) for cell in cells}

    def solve(method: Any, handle: MeteredDisplay) -> Any:
        pictures = torch.stack(list(targets.values())).to(job.device)
        if not at_once(traits_of(method), measure := cells[0].measure):
            return method.solve(pictures[:1], handle)
        solve_all = method.solve_planes if measure == "focus" else method.solve_views
        return solve_all(pictures, list(places.values()), handle)[None]

    solved = solution(job, display, targets[cells[0].target], solve)
    return lambda cell, shown_on: captured(job, solved, cell, shown_on, targets[cell.target])
