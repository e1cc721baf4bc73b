"""The scores of a capture, by metric; and what is kept so that metrics to come need no new capture."""

from __future__ import annotations

import io
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import torch
from torch import Tensor

from ...core import plugins
from ...core.errors import CellError
from ...core.io import sealed, unsealed, write_atomically
from ...metrics import control, match, score
from ...metrics.psnr import psnr
from ...metrics.ssim import RADIUS, LocalStatistics
from .. import identity
from ..plan import Cell
from ..stacks import INFOCUS, SCORES
from ..store import Store
from .job import Job


def scores_of(
    job: Job,
    cell: Cell,
    image: Tensor,
    wanted: Tensor,
    metrics: Mapping[str, str],
    answers: Mapping[str, float] = MappingProxyType({}),
    **less: Any,
) -> dict[str, Any]:
    """The scores of an image ``(C, h, w)`` against ``wanted``, by metric. metrics: versions of those to compute;
    answers: the columns of control, which no image alone has; less: what ``metrics.score`` is to leave out."""
    names = identity.named(metrics)
    columns = score(image, wanted, metrics=names, lpips_weights=job.setting.study.protocol.lpips_weights, **less)
    if INFOCUS in metrics:
        dataset = plugins.build("datasets", cell.dataset, dict(cell.dataset_params), job.setting.study.folder)
        columns |= in_focus(image, wanted, dataset.mask(cell.target, tuple(wanted.shape[-2:])))
    return identity.grouped({**columns, **answers}, metrics)


def in_focus(image: Tensor, wanted: Tensor, mask: Tensor) -> dict[str, float]:
    """PSNR over a mask, and the mean of the SSIM map over it, in linear light (paper 7.1).

    image: ``(C, h, w)``; wanted: ``(C, h, w)`` in [0, 1]; mask: ``(h, w)`` bool. Brightness is matched over the whole
    picture, as for every other score. CellError for a mask that is empty where SSIM is defined.
    """
    inner = mask[RADIUS:-RADIUS, RADIUS:-RADIUS]
    if not bool(inner.any()):
        raise CellError("nothing of this picture is in focus")
    target = wanted.double()
    matched, _ = match(image.double(), target)
    luminance, structure = LocalStatistics(target).maps(matched)
    ratio, similarity = psnr(matched[:, mask][:, None], target[:, mask][:, None]), luminance * structure
    values = ratio, similarity[:, inner].mean()
    return {name: float(value) for name, value in zip(SCORES, values, strict=True)}


def keep_capture(job: Job, cell: Cell, *images: Tensor, lasting: bool = False) -> None:
    """Keep an image ``(C, h, w)``, or one with the picture that it is compared with, as exact as it is scored and under
    the name of its cell; unless the study says not to.

    lasting: of a display that exists, whose exposures cost time.
    """
    if not job.setting.study.save.kept:
        return
    buffer = io.BytesIO()
    np.save(buffer, torch.stack(images).squeeze(0).cpu().numpy(), allow_pickle=False)
    write_atomically(job.store.capture(cell.id), sealed(buffer.getvalue(), cell.id), lasting)


def kept_capture(path: Path) -> list[Tensor]:
    """What ``keep_capture`` kept: an image, and where it has one of its own the picture that it is compared with; empty
    where nothing is kept that is whole and of the cell that the file is named after."""
    array = unsealed(path.read_bytes(), path.stem) if path.is_file() else None
    if array is None:
        return []
    values = torch.from_numpy(np.load(io.BytesIO(array), allow_pickle=False))
    return list(values) if values.ndim == 4 else [values]


def is_kept(cell: Cell, store: Store, metrics: Mapping[str, str]) -> bool:
    """Whether what is kept of a captured cell has all that the scores need that it lacks: control needs more captures.

    metrics: versions of those that are wanted, by name.
    """
    record = store.read(cell.id)
    lacking = identity.lacking(record.scores, metrics) if record else metrics
    return not (cell.code and control.NAME in lacking) and bool(kept_capture(store.capture(cell.id)))
