"""The networks that the paper compares its approximator with (Chakravarthula et al. 2020, Section 6.1, Table 1).

All give what they add to the ideal intensity, as the proposed generator does (`networks.FromIdentity`), and take any
image size: they pad with zeros and crop as it does.
"""

from __future__ import annotations

from itertools import pairwise

import torch
from torch import Tensor, nn
from torch.nn import functional

from ...imaging.shifts import mirrored
from .generator import Generator, crop_to, instance_norm, pad_to_multiple

# Networks that end in a tanh work on [-1, 1]; intensities of [0, 2] are moved there.
MIDDLE = 1.0


class Identity(nn.Module):
    """The capture is the ideal image: no aberrations, the first approximator of Algorithm 1 (D^0 = Id)."""

    def forward(self, ideal: Tensor) -> Tensor:
        """The same ``(B, C, h, w)``."""
        return ideal


class UNet(nn.Module):
    """Ronneberger, Fischer & Brox, "U-Net: convolutional networks for biomedical image segmentation", MICCAI (2015).

    Two 3 x 3 convolutions with ReLU at each resolution, 2 x 2 max pooling, 2 x 2 up-convolutions that halve the
    features, concatenation with what had this resolution before, and a 1 x 1 convolution at the end. Filters double at
    every level. The 3 x 3 convolutions are padded here, so that the image keeps its size; the publication's are not,
    and it mirrors the image's margin instead. Its dropout, whose rate is not given, is left out.
    """

    def __init__(self, inputs: int, outputs: int, levels: int = 4, width: int = 64) -> None:
        super().__init__()
        self.levels = levels
        widths = [width * 2**level for level in range(levels + 1)]
        self.encoder = nn.ModuleList(
            _two_convolutions(before, after) for before, after in zip([inputs, *widths], widths, strict=False)
        )
        upward = widths[::-1]
        self.up = nn.ModuleList(nn.ConvTranspose2d(before, after, 2, stride=2) for before, after in pairwise(upward))
        self.decoder = nn.ModuleList(_two_convolutions(before, after) for before, after in pairwise(upward))
        self.last = nn.Conv2d(width, outputs, 1)

    def forward(self, ideal: Tensor) -> Tensor:
        """A change ``(B, outputs, h, w)`` of an ideal intensity ``(B, inputs, h, w)``."""
        x = pad_to_multiple(ideal, 2**self.levels).contiguous(memory_format=torch.channels_last)
        taken = []
        for level, encode in enumerate(self.encoder):
            x = encode(functional.max_pool2d(x, 2) if level else x)
            taken.append(x)
        x = taken.pop()
        for up, decode in zip(self.up, self.decoder, strict=True):
            x = decode(torch.cat([taken.pop(), up(x)], dim=1))
        return crop_to(self.last(x), *ideal.shape[-2:])


def _two_convolutions(before: int, after: int) -> nn.Module:
    return nn.Sequential(
        *(nn.Conv2d(before, after, 3, padding=1), nn.ReLU()),
        *(nn.Conv2d(after, after, 3, padding=1), nn.ReLU()),
    )


class Pix2Pix(nn.Module):
    """The U-Net generator of Isola et al., CVPR (2017), appendix: the proposed one with its changes undone.

    Convolutions of 4 x 4 px, instance normalisation (which is their batch normalisation at batch size one), dropout in
    the first three decoding layers, skip connections before the activation, the image from the last transposed
    convolution through a tanh. The published network has dropout when it is tested, too, as its source of noise; here
    only while it is trained, so that a prediction is a function of its input.
    """

    def __init__(self, inputs: int, outputs: int, levels: int = 8, width: int = 64) -> None:
        super().__init__()
        self.generator = Generator(
            inputs,
            outputs,
            levels,
            width,
            kernel=4,
            dropout=True,
            full_resolution_stage=False,
            plain_ends=False,
            skip_after_activation=False,
        )

    def forward(self, ideal: Tensor) -> Tensor:
        """A change ``(B, outputs, h, w)`` in [-1, 1] of an ideal intensity ``(B, inputs, h, w)``."""
        return torch.tanh(self.generator(ideal - MIDDLE))


class Pix2PixHD(nn.Module):
    """The global generator of T.-C. Wang et al., "High-resolution image synthesis ...", CVPR (2018), Section 3.1.

    A 7 x 7 convolution, ``levels`` convolutions of 3 x 3 px and stride 2 that double the features each time, ``blocks``
    residual blocks, ``levels`` transposed convolutions back, and a 7 x 7 convolution through a tanh; instance
    normalisation and ReLU after all but the last, mirrored edges where the resolution is kept.
    """

    def __init__(self, inputs: int, outputs: int, levels: int = 4, width: int = 64, blocks: int = 9) -> None:
        super().__init__()
        self.levels = levels
        layers: list[nn.Module] = [Mirrored(3), nn.Conv2d(inputs, width, 7, bias=False), *_normed(width)]
        widths = [width * 2**level for level in range(levels + 1)]
        for before, after in pairwise(widths):
            layers += [nn.Conv2d(before, after, 3, stride=2, padding=1, bias=False), *_normed(after)]
        layers += [_Residual(widths[-1]) for _ in range(blocks)]
        for before, after in pairwise(reversed(widths)):
            up = nn.ConvTranspose2d(before, after, 3, stride=2, padding=1, output_padding=1, bias=False)
            layers += [up, *_normed(after)]
        self.layers = nn.Sequential(*layers, Mirrored(3), nn.Conv2d(width, outputs, 7), nn.Tanh())

    def forward(self, ideal: Tensor) -> Tensor:
        """A change ``(B, outputs, h, w)`` in [-1, 1] of an ideal intensity ``(B, inputs, h, w)``."""
        # two pixels at the lowest resolution can still be mirrored and normalised
        x = pad_to_multiple(ideal - MIDDLE, 2**self.levels, smallest=2 ** (self.levels + 1))
        x = self.layers(x.contiguous(memory_format=torch.channels_last))
        return crop_to(x, *ideal.shape[-2:])


class Mirrored(nn.Module):
    """``nn.ReflectionPad2d`` with a deterministic gradient on a GPU too."""

    def __init__(self, margin: int) -> None:
        super().__init__()
        self.margin = margin

    def forward(self, x: Tensor) -> Tensor:
        """The image with so many mirrored pixels around it."""
        return mirrored(x, self.margin)


class _Residual(nn.Module):
    """Two 3 x 3 convolutions whose result is added to their input; no activation after the sum."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.change = nn.Sequential(
            *(Mirrored(1), nn.Conv2d(width, width, 3, bias=False), *_normed(width)),
            *(Mirrored(1), nn.Conv2d(width, width, 3, bias=False), *_normed(width)[:1]),
        )

    def forward(self, x: Tensor) -> Tensor:
        changed: Tensor = x + self.change(x)
        return changed


def _normed(channels: int) -> list[nn.Module]:
    return [instance_norm(channels), nn.ReLU()]
