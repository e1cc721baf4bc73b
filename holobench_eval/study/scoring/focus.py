"""Focal stacks and light fields: the picture of every plane, photographed at its distance, or of every view, through
the eye's pupil at its place (paper 7.1)."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import torch

from ...core import plugins
from ...display import MeteredDisplay
from ...display.traits import traits_of
from ..stacks import given_views, offset
from .job import Job, Measured
from .picture import captured
from .solution import solution, wrong_output


def focus(job: Job) -> Measured:
    """Solve for one plane, or for all planes of a scene at once, on the display before any change; the result shows the
    phase at any of the task's planes and displays."""
    cells, display = job.task.cells, job.task.conditions[0].nominal
    targets = {cell.target: job.target(cell, display) for cell in cells}
    offsets = {cell.target: offset(display, cell.change) for cell in cells}

    def solve(method: Any, handle: MeteredDisplay) -> Any:
        pictures = torch.stack(list(targets.values())).to(job.device)
        if not traits_of(method).planes:
            return method.solve(pictures, handle)
        return _alone(job, "solve_planes", method.solve_planes(pictures, list(offsets.values()), handle))

    solved = solution(job, display, targets[cells[0].target], solve)
    return lambda cell, shown_on: captured(job, solved, cell, shown_on, targets[cell.target])


def views(job: Job) -> Measured:
    """Solve for the views of a scene that methods are given, or for the first of them; the result shows the phase to a
    pupil at any of the task's places and on its displays."""
    own, display = job.task.cells[0], job.task.conditions[0].nominal
    dataset = plugins.build("datasets", own.dataset, dict(own.dataset_params), job.setting.study.folder)
    given = given_views(dataset, own.target)
    cells = tuple(replace(own, target=name, target_sha256=sha256) for name, sha256, _ in given)
    solving = replace(job, task=replace(job.task, cells=cells, conditions=(display,) * len(cells)))
    pictures = torch.stack([job.target(cell, display) for cell in cells])

    def solve(method: Any, handle: MeteredDisplay) -> Any:
        if not traits_of(method).views:
            return method.solve(pictures[:1].to(job.device, copy=True), handle)
        places = [place for *_, place in given]
        return _alone(job, "solve_views", method.solve_views(pictures.to(job.device, copy=True), places, handle))

    solved = solution(solving, display, pictures[0], solve)
    return lambda cell, shown_on: captured(job, solved, cell, shown_on, job.target(cell, shown_on))


def _alone(job: Job, function: str, output: Any) -> Any:
    """The phase of a scene as that of a batch of one. CellError for what is no array."""
    if not hasattr(output, "ndim"):
        raise wrong_output(job.task.label, function, output, "a phase (C, H, W), or frames (F, C, H, W)")
    return output[None]
