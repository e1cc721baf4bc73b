"""How a trained method starts, and how it uses what it learned."""

from __future__ import annotations

from typing import TypeVar

import torch
from torch import Tensor

from ...display.metered import MeteredDisplay
from ...display.training import TrainingBench, TrainingImage
from ..wirtinger import Wirtinger
from .retrieval import Image
from .samples import Approximator

D = TypeVar("D", bound=Approximator)


def hologram(solver: Wirtinger, image: TrainingImage, bench: TrainingBench) -> Tensor:
    """The phase ``(C, H, W)`` [rad] of a training image by the nominal model."""
    return bench.solved(solver, image)


def frozen(approximator: D, bench: MeteredDisplay) -> D:
    """A fresh approximator with what the method learned; UserError where that is another network's."""
    approximator.to(bench.device)
    approximator.load_learned(bench.learned)
    return approximator


@torch.no_grad()
def predicted(display: Image, phase: Tensor) -> Tensor:
    """Phases ``(B, C, H, W)`` [rad] to the captures ``(B, C, h, w)`` that are expected of them."""
    return torch.stack([display(panel) for panel in phase])
