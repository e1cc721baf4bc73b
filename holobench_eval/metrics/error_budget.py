"""The squared error of a capture, and what of it a prediction explains, at matched brightness and in linear light.

For a target T, a capture Y of a hologram of it, and any prediction P of that capture, all ``(C, h, w)`` linear light,
the unexplained error is, per colour channel::

    e(P) = (|T|^2 / |Y|^2) min_c |Y - c P|^2 = |T|^2 (1 - cos^2(Y, P)),    c >= 0,

where norms and cosine are those of the pixels as a vector. The factor ``|T|^2 / |Y|^2`` is the unit of light: it makes
``e(T) = min_s |s Y - T|^2``, the error of the capture against its target after the protocol's match and before its clip
to [0, 1]. In a channel in which the target is black, the unit is the square of the factor that the protocol gives it:
a leak is an error here, too. So the target is the first prediction of a capture, every better prediction leaves less,
and the differences between the e of one prediction and of the next add up to e(T) exactly, whatever the predictions
are.

Two captures Y, Y' of the same hologram, each the noise-free picture M plus independent noise of the same power, have
cos(Y, Y') = cos^2(Y, M) up to the noise's own chance. So ``|T|^2 (1 - cos(Y, Y'))`` is e(M), what the best prediction
leaves: about half the squared difference of the two, since both have the noise.
"""

from __future__ import annotations

import torch
from torch import Tensor

from .protocol import factors_of

SMALLEST = 1e-12  # error that counts as none, a PSNR of 120 dB

# Names of the scores, in units of a white pixel squared: what the target, the ideal image of the hologram, the method's
# prediction and the noise-free picture leave unexplained of a capture.
TARGET, IDEAL, PREDICTION, NOISE = (
    "unexplained_by_target",
    "unexplained_by_ideal_image",
    "unexplained",
    "unexplained_but_noise",
)
# What the target leaves unexplained of the ideal image: the algorithm's own error.
ALGORITHM = "error_of_ideal_image"


def unexplained(capture: Tensor, prediction: Tensor, target: Tensor) -> float:
    """Mean of e(P) over pixels and colours, see the module.

    Parameters
    ----------
    capture, prediction
        ``(C, h, w)`` linear light, each in any unit.
    target
        ``(C, h, w)`` linear light in [0, 1], which gives the unit.

    Examples
    --------
    >>> target = torch.tensor([[[1.0, 1.0]]])
    >>> round(unexplained(torch.tensor([[[3.0, 1.0]]]), target, target), 6)
    0.2
    """
    return float((_power(capture, target) * (1 - _cosine(capture, prediction).square())).mean())


def temporal(capture: Tensor, again: Tensor, target: Tensor) -> float:
    """Mean over pixels and colours of what the noise-free picture would leave unexplained, see the module.

    capture, again: of the same hologram under independent noise, ``(C, h, w)`` each in any unit; target: as above.
    """
    return float((_power(capture, target) * (1 - _cosine(capture, again))).mean())


def _power(capture: Tensor, target: Tensor) -> Tensor:
    """That of each channel of a capture at matched brightness, ``(C,)``: the target's, unless that is black."""
    capture, target = capture.double(), target.double()
    _, common, share = factors_of(capture, target)
    return torch.lerp((common * capture).square().mean((-2, -1)), target.square().mean((-2, -1)), share)


def _cosine(first: Tensor, second: Tensor) -> Tensor:
    """Of each channel, ``(C,)``; zero where a picture is black or the two oppose each other."""
    first, second = first.double().flatten(1), second.double().flatten(1)
    size = first.norm(dim=1) * second.norm(dim=1)
    overlap = (first * second).sum(1).clamp_min(0)
    return torch.where(size > 0, overlap / torch.where(size > 0, size, 1.0), 0.0)
