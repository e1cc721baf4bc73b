"""What a display may do to an intensity, in a few numbers: shading, blur, haze and tone.

For one colour and the intensity I of a hologram at a white pixel's unit, the capture is

    g (S (x, y) ((1 - h) B_s * I + h V_r * I)) ^ gamma + b

with brightness g, light b that is there whatever is shown, the shading S = exp of a polynomial in the place, a blur
B_s by a Gaussian of widths s along both axes, and a haze: the share h of the light arrives spread by a Gaussian V_r of
reach r. Nothing here knows a phase: light adds in intensity, whoever sent it.
"""

from __future__ import annotations

import math

import torch
from torch import Tensor, nn

DEGREE = 4  # of the polynomial: a Gaussian beam off its centre needs 2, a cos^4 vignetting 4
FIRST_BLUR, FIRST_SHARE, FIRST_REACH = 0.4, 0.05, 0.1  # px; of the light; of the picture's height
DARK = 1e-6  # below it the slope of a power is not followed


class ImageTerms(nn.Module):
    """Intensity ``(C, h, w)``, 1 at a white pixel, to the capture in the same unit; every parameter is per colour.

    shading: coefficients of the polynomial without its constant. blur: logarithm of the widths [px]. share: logit of
    the share of the haze. reach: logarithm of its standard deviation [picture heights]. gamma, gain: logarithms.
    offset: light that is always there. The first values change next to nothing.
    """

    def __init__(self, channels: int, shape: tuple[int, int]) -> None:
        super().__init__()
        powers = [(p, q) for p in range(DEGREE + 1) for q in range(DEGREE + 1 - p) if p + q > 0]
        self.shading = nn.Parameter(torch.zeros(channels, len(powers)))
        self.blur = nn.Parameter(torch.full((channels, 2), math.log(FIRST_BLUR)))
        self.share = nn.Parameter(torch.full((channels,), math.log(FIRST_SHARE / (1 - FIRST_SHARE))))
        self.reach = nn.Parameter(torch.full((channels,), math.log(FIRST_REACH)))
        self.gamma = nn.Parameter(torch.zeros(channels))
        self.gain = nn.Parameter(torch.zeros(channels))
        self.offset = nn.Parameter(torch.zeros(channels))
        y, x = torch.meshgrid(*(torch.linspace(-1, 1, side) for side in shape), indexing="ij")
        self.register_buffer("monomials", torch.stack([y**p * x**q for p, q in powers]), persistent=False)

    def forward(self, intensity: Tensor) -> Tensor:
        """See the class."""
        height, width = intensity.shape[-2:]
        sharp = self.blur.exp()
        rows, columns = (spread(side, sharp[:, axis], lossless=True) for axis, side in enumerate((height, width)))
        wide = self.reach.exp() * height
        veils = spread(height, wide), spread(width, wide)
        share = self.share.sigmoid()[:, None, None]
        light = (1 - share) * (rows @ intensity @ columns.mT) + share * (veils[0] @ intensity @ veils[1].mT)
        light = torch.exp(torch.einsum("cm,mhw->chw", self.shading, self.monomials)) * light
        gamma, gain = (value.exp()[:, None, None] for value in (self.gamma, self.gain))
        return gain * light.clamp_min(DARK) ** gamma + self.offset[:, None, None]


def spread(side: int, width: Tensor, lossless: bool = False) -> Tensor:
    """Gaussians ``(C, side, side)`` of standard deviations ``width`` ``(C,)`` [px] around each pixel of a line.

    It is dark beyond the ends, and what is spread there is lost. ``lossless``: each pixel is a weighted mean of those
    of the line, so that flat light stays flat up to the ends; light of pixels near them is then not conserved.
    """
    places = torch.arange(side, dtype=width.dtype, device=width.device)
    gaussians = torch.exp(-((places[:, None] - places) ** 2) / (2 * width[:, None, None] ** 2))
    total = gaussians.sum(-1, keepdim=True) if lossless else math.sqrt(math.tau) * width[:, None, None]
    return gaussians / total
