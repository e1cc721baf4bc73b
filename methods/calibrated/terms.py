"""What a display may do to an intensity, in a few numbers: shading, blur, haze and tone.

For one colour and the intensity I of a hologram at a white pixel's unit, the capture is

    g (S (x, y) ((1 - h) B_s * I + h V_r * I)) ^ gamma + b

with brightness g, light b that is there whatever is shown, the shading S = exp of a polynomial in the place, a blur
B_s by a Gaussian of widths s along both axes, and a haze: the share h of the light arrives spread by a Gaussian V_r of
reach r. Nothing here knows a phase: light adds in intensity, whoever sent it. I is that of the entire panel, since the
light beside the region, half of all that a dark picture has, adds to the haze within.
"""

from __future__ import annotations

import math
from functools import lru_cache

import torch
from torch import Tensor, nn

from ...core.graphs import is_recorded
from ...display.api import DisplaySpec
from ...display.nominal import ideal_light

DEGREE = 4  # of the polynomial: a Gaussian beam off its centre needs 2, a cos^4 vignetting 4
FIRST_BLUR, FIRST_SHARE, FIRST_REACH = 0.4, 0.05, 0.1  # px; of the light; of the panel's height
NARROW = 4.0  # px, of a haze: below it, `scattered` takes as long as matrices of the picture's size
DARK = 1e-6  # below it the slope of a power is not followed


class IdealImage(nn.Module):
    """Phase ``(C, H, W)`` [rad] to the intensity ``(C, H, W)`` of the nominal model; nothing to learn."""

    def __init__(self, spec: DisplaySpec) -> None:
        super().__init__()
        self.spec = spec

    def over_panel(self, phase: Tensor) -> Tensor:
        """See the class."""
        return ideal_light(phase, self.spec)


class Haze(nn.Module):
    """Haze and offset, for a model whose field has the rest: the formula with S = 1, no blur, g = 1 and gamma = 1.

    Intensity ``(C, H, W)`` over the panel, 1 at a white pixel, to the capture ``(C, h, w)`` of the region in the same
    unit; every parameter is per colour. share: logit of the share of the haze. reach: logarithm of its standard
    deviation [panel heights]. offset: light that is always there. The first values change next to nothing.
    """

    def __init__(self, spec: DisplaySpec) -> None:
        super().__init__()
        channels = len(spec.wavelengths)
        self.region = spec.region
        self.share = nn.Parameter(torch.full((channels,), math.log(FIRST_SHARE / (1 - FIRST_SHARE))))
        self.reach = nn.Parameter(torch.full((channels,), math.log(FIRST_REACH)))
        self.offset = nn.Parameter(torch.zeros(channels))

    def forward(self, intensity: Tensor) -> Tensor:
        """See the class."""
        return self._hazy(intensity, intensity) + self.offset[:, None, None]

    def _hazy(self, sharp: Tensor, intensity: Tensor) -> Tensor:
        """What a picture ``(C, H, W)`` keeps, and the haze of an intensity, in the region ``(C, h, w)``."""
        share, widths = self.share.sigmoid()[:, None, None], self.reach.exp() * intensity.shape[-2]
        if widths.requires_grad or is_recorded(widths.device) or float(widths.min()) < NARROW:
            rows, columns = (spread(side, widths) for side in intensity.shape[-2:])
            haze = rows @ intensity @ columns.mT
        else:  # held for a retrieval
            colours = zip(intensity, widths.tolist(), strict=True)
            haze = torch.stack([scattered(*colour) for colour in colours])
        return self.region.crop((1 - share) * sharp + share * haze)


class ImageTerms(Haze):
    """All of the formula.

    shading: coefficients of the polynomial without its constant. blur: logarithm of the widths [px]. gain, gamma:
    logarithms.
    """

    def __init__(self, spec: DisplaySpec) -> None:
        super().__init__(spec)
        channels = len(spec.wavelengths)
        powers = [(p, q) for p in range(DEGREE + 1) for q in range(DEGREE + 1 - p) if p + q > 0]
        self.shading = nn.Parameter(torch.zeros(channels, len(powers)))
        self.blur = nn.Parameter(torch.full((channels, 2), math.log(FIRST_BLUR)))
        self.gain = nn.Parameter(torch.zeros(channels))
        self.gamma = nn.Parameter(torch.zeros(channels))
        y, x = torch.meshgrid(*(torch.linspace(-1, 1, side) for side in spec.region.shape), indexing="ij")
        self.register_buffer("monomials", torch.stack([y**p * x**q for p, q in powers]), persistent=False)

    def forward(self, intensity: Tensor) -> Tensor:
        """See the base."""
        widths = self.blur.exp()
        rows, columns = (spread(side, widths[:, axis], True) for axis, side in enumerate(intensity.shape[-2:]))
        return self._counted(self._hazy(rows @ intensity @ columns.mT, intensity))

    def _counted(self, light: Tensor) -> Tensor:
        """Shading and tone of the light ``(C, h, w)`` of the region, and the offset."""
        gain, gamma = (value.exp()[:, None, None] for value in (self.gain, self.gamma))
        return gain * (self.shaded() * light).clamp_min(DARK) ** gamma + self.offset[:, None, None]

    def shaded(self) -> Tensor:
        """The factor of the light over the region, ``(C, h, w)``."""
        return torch.exp(torch.einsum("cm,mhw->chw", self.shading, self.monomials))


def spread(side: int, width: Tensor, lossless: bool = False) -> Tensor:
    """Gaussians ``(C, side, side)`` of standard deviations ``width`` ``(C,)`` [px] around each pixel of a line.

    It is dark beyond the ends, and what is spread there is lost. ``lossless``: each pixel is a weighted mean of those
    of the line, so that flat light stays flat up to the ends; light of pixels near them is then not conserved.
    """
    places = torch.arange(side, dtype=width.dtype, device=width.device)
    gaussians = torch.exp(-((places[:, None] - places) ** 2) / (2 * width[:, None, None] ** 2))
    total = gaussians.sum(-1, keepdim=True) if lossless else math.sqrt(math.tau) * width[:, None, None]
    return gaussians / total


def scattered(image: Tensor, width: float) -> Tensor:
    """Images ``(..., H, W)`` spread as by ``spread`` along both axes, ``width``: of the Gaussian [px].

    A Gaussian is a narrower one convolved with itself, and that integral is, to 1e-8, a sum over nodes half a width
    apart. A wide one needs few of them, and products with their matrices take a fraction of the time.
    """
    down, across = (_nodes(side, width).to(image) for side in image.shape[-2:])
    return down.mT @ (down @ image @ across.mT) @ across


@lru_cache(maxsize=64)
@torch.inference_mode(False)
def _nodes(side: int, width: float) -> Tensor:
    """The root ``(nodes, side)`` of ``spread``, which is ``root.mT @ root``."""
    nodes = torch.arange(-9, 2 * side / width + 9, dtype=torch.float64)[:, None] * (width / 2)
    return torch.exp(-(((torch.arange(side) - nodes) / width) ** 2)) / math.sqrt(math.tau * width)
