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

Both captures have noise that nobody predicts, so even a perfect model has less than 1. How much it has on average is
known from a second capture C" of the unchanged hologram, which differs from the first by as much noise::

    most = 1 - |C" - C|^2 / |C' - C|^2
"""

from __future__ import annotations

from collections.abc import Mapping

from torch import Tensor

from .protocol import match

NAME, VERSION = "control", "1"
HALF, PATCH, PHASE = CHANGES = ("half", "patch", "phase")
MOST = f"{NAME}_most"
COLUMNS = (NAME, *(f"{NAME}_{change}" for change in CHANGES), MOST)


def control(
    capture: Tensor, again: Tensor, prediction: Tensor, changed: Mapping[str, tuple[Tensor, Tensor]]
) -> dict[str, float]:
    """The control of every change, their mean, and the mean of the most that noise allows.

    Parameters
    ----------
    capture, again, prediction
        Of the unchanged hologram, ``(C, h, w)`` linear light: two captures in one unit, the prediction in any.
    changed
        By change, capture and prediction of the changed hologram, in the same units.

    Examples
    --------
    The display gets brighter by 1; the model, whose numbers are twice those of the display, says by 1/2:

    >>> import torch
    >>> before = torch.tensor([[[1.0, 2.0]]])
    >>> control(before, before + 0.5, 2 * before, {"patch": (before + 1, 2 * before + 1)})
    {'control_patch': 0.75, 'control': 0.75, 'control_most': 0.75}
    """
    capture, again, prediction = capture.double(), again.double(), prediction.double()
    _, factors = match(prediction, capture)
    noise, found, most = (again - capture).square().sum(), {}, []
    for change, (other, answered) in changed.items():
        wanted, answer = other - capture, factors.view(-1, 1, 1) * (answered - prediction)
        size = wanted.square().sum()
        found[f"{NAME}_{change}"] = 1 - float((answer - wanted).square().sum() / size)
        most.append(1 - float(noise / size))
    return found | {NAME: sum(found.values()) / len(found), MOST: sum(most) / len(most)}
