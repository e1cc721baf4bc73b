"""PatchGAN discriminators: is each patch of an image a capture or a prediction?

Isola, Zhu, Zhou & Efros, "Image-to-image translation with conditional adversarial networks", CVPR (2017),
Section 3.2.2.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import cast

import torch
from torch import Tensor, nn
from torch.nn import functional

from ...core.errors import UserError
from .generator import SLOPE, instance_norm

KERNEL = 4


class PatchDiscriminator(nn.Module):
    """Convolutions of 4 x 4 px, ``down`` with stride 2 and then ``flat`` with stride 1, that judge overlapping patches.

    Three and three are the paper's 94 x 94 patches (Chakravarthula et al. 2020, Section 4.3.1), three and two the
    70 x 70 of Pix2Pix. Filters double from ``width`` up to eight times as many, then one channel, the judgement; no
    normalisation in the first layer and the last. The paper's sigmoid is left to the loss (``binary cross entropy with
    logits``), where it does not overflow.

    channels: of the judged image. condition: channels of the ideal intensity that is judged along with it, the paper's
    conditional discriminator; 0 judges the image alone.
    """

    def __init__(self, channels: int, condition: int, width: int = 64, down: int = 3, flat: int = 3) -> None:
        super().__init__()
        self.condition = condition
        widths = [width * min(2**layer, 8) for layer in range(down + flat - 1)]
        befores = [channels + condition, *widths]
        self.layers = nn.ModuleList()
        for layer, (before, after) in enumerate(zip(befores, [*widths, 1], strict=True)):
            normed = 0 < layer < len(widths)
            stride = 2 if layer < down else 1
            convolution = nn.Conv2d(before, after, KERNEL, stride=stride, padding=1, bias=not normed)
            self.layers.append(nn.Sequential(convolution, *([instance_norm(after)] if normed else [])))
        # each stride-1 layer takes a pixel off, and one must be left
        self.smallest = 2**down * (flat + 1)

    def forward(self, image: Tensor, ideal: Tensor) -> Tensor:
        """Logits ``(B, 1, h', w')`` that the patches are captures, for linear light ``(B, channels, h, w)``."""
        return self.judge(image, ideal)[0][-1]

    def judge(self, image: Tensor, ideal: Tensor) -> list[list[Tensor]]:
        """The activations of every layer, the logits last, for each scale; here there is one scale.

        Raises UserError for an image too small to leave a patch.
        """
        _check_size(image, self.smallest)
        x = torch.cat([image, ideal], dim=1) if self.condition else image
        x = x.contiguous(memory_format=torch.channels_last)
        activations = []
        for layer in self.layers[:-1]:
            x = functional.leaky_relu(layer(x), SLOPE)
            activations.append(x)
        return [[*activations, self.layers[-1](x)]]


class MultiScaleDiscriminator(nn.Module):
    """The same 70 x 70 discriminator, with weights of its own, on the image at full, half and quarter resolution.

    T.-C. Wang et al., "High-resolution image synthesis and semantic manipulation with conditional GANs", CVPR (2018),
    Section 3.2. Arguments as in ``PatchDiscriminator``; the images are averaged over 3 x 3 px from scale to scale.
    """

    def __init__(self, channels: int, condition: int, width: int = 64, scales: int = 3) -> None:
        super().__init__()
        patches = [PatchDiscriminator(channels, condition, width, flat=2) for _ in range(scales)]
        self.scales = nn.ModuleList(patches)
        # a half is rounded up
        self.smallest = (patches[-1].smallest - 1) * 2 ** (scales - 1) + 1

    def forward(self, image: Tensor, ideal: Tensor) -> Tensor:
        """Logits of all patches at all scales ``(B, patches)`` for linear light ``(B, channels, h, w)``."""
        return torch.cat([activations[-1].flatten(1) for activations in self.judge(image, ideal)], dim=1)

    def judge(self, image: Tensor, ideal: Tensor) -> list[list[Tensor]]:
        """The activations of every layer, the logits last, for each scale from fine to coarse.

        Raises UserError for an image too small to leave a patch.
        """
        _check_size(image, self.smallest)
        judged = []
        for level, scale in enumerate(cast("Iterable[PatchDiscriminator]", self.scales)):
            if level:
                image, ideal = (
                    functional.avg_pool2d(x, 3, stride=2, padding=1, count_include_pad=False) for x in (image, ideal)
                )
            judged += scale.judge(image, ideal)
        return judged


def _check_size(image: Tensor, smallest: int) -> None:
    if min(image.shape[-2:]) < smallest:
        size = " x ".join(str(side) for side in image.shape[-2:])
        raise UserError(f"this discriminator needs images of at least {smallest} x {smallest} px, got {size}")
