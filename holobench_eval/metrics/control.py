"""How well a model answers changes of a hologram: what a method needs that optimises through the model.

A model can predict captures well and yet not know what the display does when the hologram changes: a tone curve of the
ideal image predicts a veil of stray light, but not that the veil goes when the light does that it came from. So each
hologram is changed in three ways, and display and model see the same four holograms. For a change with captures C of
the unchanged and C' of the changed hologram, and predictions P and P' of both, all ``(C, h, w)`` linear light::

    control = 1 - |k (P' - P) - (C' - C)|^2 / |C' - C|^2

1: the model answers as the display does; 0: as if it had not answered; negative: worse than that. Captures are in the
unit of the exposure, which is the same for all four, and the sum is over all colours. k is a factor a colour, the one
that matches P to C: models may predict in any unit, as for all other scores. It is taken from the unchanged pair
alone, so what a change does to brightness is a part of the answer.

Both captures have noise, of power N each, so even the noise-free picture has no more than 1 - 2 N / |C' - C|^2.
"""

from __future__ import annotations

from collections.abc import Mapping

from torch import Tensor

from .protocol import match

NAME, VERSION = "control", "1"
HALF, PATCH, PHASE = CHANGES = ("half", "patch", "phase")
COLUMNS = (NAME, *(f"{NAME}_{change}" for change in CHANGES))


def control(capture: Tensor, prediction: Tensor, changed: Mapping[str, tuple[Tensor, Tensor]]) -> dict[str, float]:
    """The control of every change, and their mean.

    Parameters
    ----------
    capture, prediction
        Of the unchanged hologram, ``(C, h, w)`` linear light, each in any unit.
    changed
        By change, capture and prediction of the changed hologram, in the same units.

    Examples
    --------
    The display gets brighter by 1; the model, whose numbers are twice those of the display, says by 1/2:

    >>> import torch
    >>> before = torch.tensor([[[1.0, 2.0]]])
    >>> control(before, 2 * before, {"patch": (before + 1, 2 * before + 1)})
    {'control_patch': 0.75, 'control': 0.75}
    """
    _, factors = match(prediction.double(), capture.double())
    found = {}
    for change, (other, answered) in changed.items():
        wanted = other.double() - capture.double()
        answer = factors.view(-1, 1, 1) * (answered.double() - prediction.double())
        found[f"{NAME}_{change}"] = 1 - float((answer - wanted).square().sum() / wanted.square().sum())
    return found | {NAME: sum(found.values()) / len(found)}
