"""The metric protocol, version 2: everything between a rectified capture and its scores.

Any change to a value that ``score`` gives is a new version.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterable, Sequence
from functools import lru_cache
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from ..core.errors import UserError, suggest
from ..imaging.refine import Refinement
from ..optics.colour import srgb_encode
from .base import Domain, Metric, gaussian_blur, remembered
from .catalogue import catalogue
from .speckle import speckle_contrast

VERSION = "v2"
SMALLEST_SCORED = 16
NEARLY_BLACK = 1 / 255  # of white; the brightest of a target has more
DIMMEST = 0.05  # of the light of the brightest colour; no colour of the photographs here has less than 0.07

Image = Tensor | NDArray[np.floating]

_ENCODINGS: dict[Domain, Callable[[Tensor], Tensor]] = {
    "linear": lambda light: light,
    "amplitude": torch.sqrt,
    "srgb": lambda light: _by_channel(srgb_encode, light),
    "stored": lambda values: values,
}
# What the scores need of a target alone, for repeats, displays and floor images one after the other.
_encoded_target = {domain: remembered(encode, most=2) for domain, encode in _ENCODINGS.items()}
_refinement = remembered(Refinement, most=2)
_REPEATED = ("psnr", "ssim")  # also given after refinement and after blur


def match(capture: Tensor, target: Tensor) -> tuple[Tensor, Tensor]:
    """Match the brightness of each colour channel by least squares, then clip to [0, 1].

    The factor is sum(I T) / sum(I I) in linear light over the entire region, without an offset, and never negative. A
    channel in which the target is black gets the factor of the others, see ``factors_of``.

    Parameters
    ----------
    capture
        ``(C, h, w)`` linear light in any unit.
    target
        ``(C, h, w)`` linear light in [0, 1].

    Returns
    -------
    image
        ``(C, h, w)``, matched.
    factors
        ``(C,)``; a channel in which the capture is black stays black.

    Examples
    --------
    >>> image, factors = match(torch.full((1, 2, 2), 4.0), torch.full((1, 2, 2), 0.5))
    >>> float(factors), float(image.mean())
    (0.125, 0.5)

    Where only the first channel of the target has light, light in the second is an error:

    >>> target = torch.tensor([0.5, 0.0, 0.0]).view(3, 1, 1).expand(3, 2, 2)
    >>> image, factors = match(torch.tensor([4.0, 2.0, 0.0]).view(3, 1, 1).expand(3, 2, 2), target)
    >>> factors.tolist(), image[:, 0, 0].tolist()
    ([0.125, 0.125, 0.125], [0.5, 0.25, 0.0])
    """
    own, common, share = factors_of(capture, target)
    factors = torch.lerp(common, own, share)
    return (factors.view(-1, 1, 1) * capture).clamp_(0, 1), factors


def factors_of(capture: Tensor, target: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """The parts of the factors of a match.

    A factor of its own would dim a channel in which the target is black until its light is gone, and so forgive any
    leak. The share goes to zero in proportion to the target's light, since a few pixels that are not black would bring
    such a factor back. It depends on the target alone, so no capture can choose.

    Parameters
    ----------
    capture, target
        As of ``match``.

    Returns
    -------
    own
        ``(C,)``, the least-squares factor of each channel alone.
    common
        ``()``, the mean of these, weighted by the target's light: one that a leak made small counts for little.
    share
        ``(C,)``, of its own in the factor of a channel: 1 where the target's mean in it is at least `DIMMEST` of the
        mean in its brightest channel, 0 where the target is black, linear in between.
    """
    # Divided by the peak first, so that the squares neither overflow nor vanish.
    peak = torch.maximum(capture.amax(dim=(1, 2), keepdim=True), -capture.amin(dim=(1, 2), keepdim=True))
    peak = torch.where(peak > 0, peak, 1.0)
    scaled = capture / peak
    product = (scaled * target).sum(dim=(1, 2)).clamp_min(0)
    own = _ratio(product, scaled.square().sum(dim=(1, 2))) / peak.flatten()
    light = target.mean(dim=(1, 2))
    return own, _ratio((light * own).sum(), light.sum()), _ratio(light, DIMMEST * light.max()).clamp(0, 1)


def _ratio(dividend: Tensor, divisor: Tensor) -> Tensor:
    """The quotient, and zero where it is divided by zero."""
    return torch.where(divisor > 0, dividend / torch.where(divisor > 0, divisor, 1.0), 0.0)


@torch.no_grad()
def score(
    capture: Image,
    target: Image,
    *,
    refine: bool = True,
    blur: Sequence[float] = (0.5, 1.0),
    metrics: Collection[str] | None = None,
    lpips_weights: str | Path | None = None,
    stored: bool = False,
) -> dict[str, float]:
    """All scores of a capture against its target, after the intensity match (protocol v2).

    Parameters
    ----------
    capture
        ``(C, h, w)`` linear light in any unit, dark level subtracted; noise may make it negative.
    target
        ``(C, h, w)`` linear light in [0, 1]; C = 1 or 3, sides of at least 16 px.
    refine
        Also score after the bounded rigid refinement, whose move is given.
    blur
        Widths [px] of Gaussians by which capture and target alike are blurred, in linear light and before the match.
    metrics
        Names to compute (as in ``catalogue``, and ``speckle_contrast``), default all.
    lpips_weights
        File or folder of the LPIPS trunk, by default torch's hub cache.
    stored
        Both are values as pictures store them, display-encoded, and are compared as they are: matched, refined, blurred
        and scored without decoding. The only domain is then ``stored``, and there is no speckle contrast.

    Returns
    -------
    dict of float
        ``<metric>_<domain>``; ``<metric>_linear_refined`` and ``<metric>_linear_blur<width>`` for PSNR and SSIM
        (``stored`` in the place of ``linear`` for stored values); ``refine_dx_px``, ``refine_dy_px``,
        ``refine_theta_deg``; ``speckle_contrast``; ``brightness_ratio``, mean of the capture over mean of the target
        before the match; ``scale_<channel>``, the match's factors. Absent is what cannot be computed: a metric without
        its weights or for a larger image, the speckle contrast without a flat patch.

    Raises
    ------
    ValueError
        Wrong shapes, values that are not finite, a target outside [0, 1] or black in all channels.
    UserError
        Unknown metric names, LPIPS weights that are named but cannot be used.

    Examples
    --------
    >>> target = torch.linspace(0, 1, 1024).view(1, 32, 32)
    >>> scores = score(target / 2, target, metrics=("psnr",), refine=False, blur=())
    >>> round(scores["psnr_linear"]), scores["scale_0"]
    (80, 2.0)
    """
    light, wanted = _as_pair(capture, target)
    names, chosen = _chosen(metrics, lpips_weights)
    first: Domain = "stored" if stored else "linear"
    image, factors = match(light, wanted)
    scores = _in_domains(image, wanted, chosen, ("stored",) if stored else None)
    del image
    if repeated := [metric for metric in chosen if metric.name in _REPEATED]:
        if refine:
            scores |= _refined(light, factors, wanted, repeated, first)
        for sigma in blur:
            scores |= _softly(light, wanted, repeated, first, sigma)
    if "speckle_contrast" in names and not stored:
        contrast = speckle_contrast(light, wanted)
        scores |= {} if math.isnan(contrast) else {"speckle_contrast": contrast}
    scores["brightness_ratio"] = float(light.mean() / wanted.mean())
    return scores | {f"scale_{channel}": float(factor) for channel, factor in enumerate(factors)}


# Each of the next three lets go of the images that it makes: those of a large picture would fill the memory together.


def _in_domains(
    image: Tensor, wanted: Tensor, metrics: Iterable[Metric], domains: tuple[Domain, ...] | None
) -> dict[str, float]:
    """The scores of a matched image by all metrics that its size allows, in some domains, by default the metric's."""
    scores: dict[str, float] = {}
    computed = [metric for metric in metrics if min(image.shape[1:]) >= metric.smallest]
    for domain in _ENCODINGS:
        if here := [metric for metric in computed if domain in (domains or metric.domains)]:
            encoded, reference = _ENCODINGS[domain](image), _encoded_target[domain](wanted)
            scores |= {f"{metric.name}_{domain}": float(metric.function(encoded, reference)) for metric in here}
            del encoded, reference
    return scores


def _refined(
    light: Tensor, factors: Tensor, wanted: Tensor, metrics: Iterable[Metric], domain: Domain
) -> dict[str, float]:
    """The scores after the bounded rigid refinement, and its move. factors: of the match, by channel."""
    moved = _refinement(wanted)(factors.view(-1, 1, 1) * light)
    again, _ = match(moved.image.to(wanted), wanted)
    scores = {f"{metric.name}_{domain}_refined": float(metric.function(again, wanted)) for metric in metrics}
    return scores | {"refine_dx_px": moved.dx, "refine_dy_px": moved.dy, "refine_theta_deg": moved.theta}


def _softly(light: Tensor, wanted: Tensor, metrics: Iterable[Metric], domain: Domain, sigma: float) -> dict[str, float]:
    """The scores of both, blurred alike by a Gaussian of this width [px]."""
    target = _softened(sigma)(wanted)
    soft, _ = match(_blurred(light, sigma), target)
    return {f"{m.name}_{domain}_blur{sigma:g}": float(m.function(soft, target)) for m in metrics}


@lru_cache(maxsize=8)
def _softened(sigma: float) -> Callable[[Tensor], Tensor]:
    """What puts a target behind a Gaussian of width sigma [px]."""
    return remembered(lambda target: _blurred(target, sigma).clamp_(0, 1), most=2)


def _as_pair(capture: Image, target: Image) -> tuple[Tensor, Tensor]:
    """Both as float64 tensors on one device; float64, since SSIM subtracts nearly equal squares."""
    light, wanted = (
        side if isinstance(side, Tensor) else torch.from_numpy(np.array(side)) for side in (capture, target)
    )
    for name, side in (("capture", light), ("target", wanted)):
        if not side.is_floating_point():  # levels of a picture, or counts
            raise ValueError(f"the {name} is of {side.dtype}; expected linear light as floating point")
    light, wanted = light.detach().double(), wanted.detach().double()
    light = light.to(wanted.device)
    if light.shape != wanted.shape or light.ndim != 3 or light.shape[0] not in (1, 3):
        raise ValueError(
            f"capture {tuple(light.shape)} and target {tuple(wanted.shape)} must both be (C, h, w) with C = 1 or 3"
        )
    if min(light.shape[1:]) < SMALLEST_SCORED:
        raise ValueError(f"image sides must be at least {SMALLEST_SCORED} pixels, got {tuple(light.shape[1:])}")
    if not bool(light.isfinite().all()):
        raise ValueError("the capture holds values that are not finite")
    low, high = (float(value) for value in wanted.aminmax())
    if not (low >= -1e-6 and high <= 1 + 1e-6):
        raise ValueError(f"target values must be in [0, 1], got [{low:.6g}, {high:.6g}]")
    if high < NEARLY_BLACK:  # whatever is photographed, it is near to such a target
        dim = f"has at most {high:.2g} of white" if high > 0 else "is black"
        raise ValueError(f"the target {dim}; expected light in at least one of its colours")
    return light, wanted if low >= 0 and high <= 1 else wanted.clamp(0, 1)  # a copy of a large one counts


def _chosen(names: Collection[str] | None, weights: str | Path | None) -> tuple[set[str], list[Metric]]:
    """The wanted names, and those of the full-reference metrics that can be computed here."""
    known = catalogue(None if weights is None else Path(weights))
    allowed = {"speckle_contrast", *(metric.name for metric in known)}
    wanted = allowed if names is None else set(names)
    for name in sorted(wanted - allowed):
        raise UserError(f"unknown metric '{name}'; {suggest(name, allowed)}")
    chosen = [metric for metric in known if metric.name in wanted]
    reasons = {metric.name: metric.available() for metric in chosen}
    missing = [f"{name}: {why}" for name, why in reasons.items() if name.startswith("lpips") and why is not None]
    if weights is not None and missing and len(missing) == sum(name.startswith("lpips") for name in reasons):
        raise UserError(missing[0])
    return wanted, [metric for metric in chosen if reasons[metric.name] is None]


def _blurred(image: Tensor, sigma: float) -> Tensor:
    if not 0 < 4 * sigma < min(image.shape[1:]) - 1:
        raise ValueError(f"blur width {sigma} px must be positive and less than a quarter of the image's side")
    return _by_channel(lambda channel: gaussian_blur(channel[None, None], sigma)[0, 0], image)


def _by_channel(function: Callable[[Tensor], Tensor], image: Tensor) -> Tensor:
    """What a function makes of each channel ``(h, w)``, one after the other: a large image takes less memory so."""
    made = torch.empty_like(image)
    for channel, result in zip(image, made, strict=True):
        result.copy_(function(channel))
    return made
