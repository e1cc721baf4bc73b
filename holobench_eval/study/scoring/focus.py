"""Focal stacks: the picture of every plane, photographed at its distance, scored where it is in focus (paper 7.1)."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor

from ...core import plugins
from ...core.errors import CellError
from ...display import MeteredDisplay
from ...metrics import match
from ...metrics.psnr import psnr
from ...metrics.ssim import RADIUS, LocalStatistics
from ..focal_stacks import SCORES, offset
from ..plan import Cell
from .job import Job, Measured
from .picture import captured, protocol_scores, references
from .solution import solution


def focus(job: Job) -> Measured:
    """Solve for one plane, or for all planes of a scene at once, on the display before any change; the result shows the
    phase at any of the task's planes and displays."""
    cells, display = job.task.cells, job.task.conditions[0].nominal
    targets = {cell.target: job.target(cell, display) for cell in cells}
    offsets = {cell.target: offset(display, cell.change) for cell in cells}

    def solve(method: Any, handle: MeteredDisplay) -> Any:
        pictures = torch.stack(list(targets.values())).to(job.device)
        if getattr(method, "planes", False):
            return method.solve_planes(pictures, list(offsets.values()), handle)[None]
        return method.solve(pictures, handle)

    solved = solution(job, display, targets[cells[0].target], solve)
    return lambda cell, shown_on: captured(job, solved, cell, shown_on, targets[cell.target], scored)


def floor(job: Job) -> Measured:
    """The scores of floor images on the task's target."""
    return references(job, job.target, scored)


def scored(job: Job, cell: Cell, image: Tensor, wanted: Tensor) -> dict[str, float]:
    """The scores of the full picture, and of its part in focus."""
    dataset = plugins.build("datasets", cell.dataset, dict(cell.dataset_params), job.setting.folder)
    mask = dataset.mask(cell.target, tuple(wanted.shape[-2:]))
    return protocol_scores(job, cell, image, wanted) | in_focus(image, wanted, mask)


def in_focus(image: Tensor, wanted: Tensor, mask: Tensor) -> dict[str, float]:
    """PSNR over a mask, and the mean of the SSIM map over it, in linear light.

    image: ``(C, h, w)``; wanted: ``(C, h, w)`` in [0, 1]; mask: ``(h, w)`` bool. Brightness is matched over the whole
    picture, as for every other score. CellError for a mask that is empty where SSIM is defined.
    """
    inner = mask[RADIUS:-RADIUS, RADIUS:-RADIUS]
    if not bool(inner.any()):
        raise CellError("nothing of this picture is in focus")
    target = wanted.double()
    matched, _ = match(image.double(), target)
    luminance, structure = LocalStatistics(target).maps(matched)
    values = (
        psnr(matched[:, mask][:, None], target[:, mask][:, None]),
        (luminance * structure)[:, inner].mean(),
    )
    return {name: float(value) for name, value in zip(SCORES, values, strict=True)}
