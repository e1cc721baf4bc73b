"""The aberration approximator's generator, a modified U-Net.

Chakravarthula, Tseng, Srivastava, Fuchs & Heide, "Learned hardware-in-the-loop phase retrieval for holographic
near-eye displays", ACM Trans. Graph. 39(6), 186 (2020), Section 4.3.1. It starts from the generator of Isola, Zhu, Zhou
& Efros, "Image-to-image translation with conditional adversarial networks", CVPR (2017), and changes four things, each
of which can be undone here.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional

SLOPE = 0.2  # of the encoder's LeakyReLU (Isola et al., appendix)
DROPPED_LAYERS = 3  # decoding layers with dropout in Pix2Pix, from the innermost on


def pad_to_multiple(image: Tensor, multiple: int, smallest: int = 1) -> Tensor:
    """Zeros around ``(B, C, h, w)``, equal on both sides up to a pixel: sides become multiples, ``smallest`` or more.

    Section 5.2 pads 1080 x 1920 to 1280 x 2048 for eight levels, which are the next multiples of 2^8.
    """
    height, width = (max(-(-side // multiple) * multiple, smallest) - side for side in image.shape[-2:])
    return functional.pad(image, (width // 2, width - width // 2, height // 2, height - height // 2))


def crop_to(image: Tensor, height: int, width: int) -> Tensor:
    """The middle of ``(..., H, W)`` that ``pad_to_multiple`` put there, ``(..., height, width)``."""
    top, left = (image.shape[-2] - height) // 2, (image.shape[-1] - width) // 2
    return image[..., top : top + height, left : left + width]


def instance_norm(channels: int) -> nn.Module:
    """Each channel of each image to zero mean and unit variance, then a learned factor and offset."""
    return nn.InstanceNorm2d(channels, affine=True)


class Dropout(nn.Dropout):
    """Torch's own, with the random numbers of the CPU on every device."""

    def forward(self, input: Tensor) -> Tensor:
        """While training, features are set to zero with the probability ``p``, and the others enlarged to match."""
        if not self.training:
            return input
        kept = torch.empty_like(input, device="cpu").bernoulli_(1 - self.p)
        return input * kept.div_(1 - self.p).to(input.device)


class Generator(nn.Module):
    """Ideal intensity to its change, linear light ``(B, inputs, h, w)`` to ``(B, outputs, h, w)``, any h and w.

    levels: stride-2 convolutions of ``kernel`` px (5 in the paper, 4 in Pix2Pix), and as many transposed ones of
    4 px. width: filters of the first level, doubled from level to level up to eight times as many.

    The four changes to Pix2Pix, and what it is like without them:
    dropout: absent. Pix2Pix drops half the features of the three innermost decoding layers while training.
    full_resolution_stage: the last transposed convolution makes ``width / 2`` features at full resolution and one more
    convolution the image. Pix2Pix makes the image in the transposed convolution.
    plain_ends: the first two encoding and the last two decoding layers have no instance normalisation. Pix2Pix
    leaves it out in the first and where the image is made.
    skip_after_activation: skip connections branch off after the encoder's LeakyReLU. Pix2Pix branches off before, and
    what is skipped goes through the decoder's ReLU.

    The innermost encoding layer is never normalised, as Isola et al. correct in their errata: of a single pixel nothing
    would be left. What the paper leaves open: the last convolution has 3 x 3 px, its output is the change of the ideal
    intensity without a bound such as Pix2Pix's tanh, and their sum is bounded below by zero (`networks.FromIdentity`).
    """

    def __init__(
        self,
        inputs: int,
        outputs: int,
        levels: int = 8,
        width: int = 64,
        *,
        kernel: int = 5,
        dropout: bool = False,
        full_resolution_stage: bool = True,
        plain_ends: bool = True,
        skip_after_activation: bool = True,
    ) -> None:
        super().__init__()
        self.levels = levels
        self.skip_after_activation = skip_after_activation
        widths = [width * min(2**level, 8) for level in range(levels)]
        self.encoder = nn.ModuleList()
        for level, (before, after) in enumerate(zip([inputs, *widths], widths, strict=False)):
            normed = (2 if plain_ends else 1) <= level < levels - 1
            down = nn.Conv2d(before, after, kernel, stride=2, padding=(kernel - 1) // 2, bias=not normed)
            self.encoder.append(nn.Sequential(down, *([instance_norm(after)] if normed else [])))
        self.decoder = nn.ModuleList()
        last = width // 2 if full_resolution_stage else outputs
        for level in reversed(range(levels)):
            makes_image = level == 0 and not full_resolution_stage
            normed = not makes_image and not (plain_ends and level < 2)
            before = widths[level] * (1 if level == levels - 1 else 2)  # a skip connection doubles the features
            after = widths[level - 1] if level else last
            up = nn.ConvTranspose2d(before, after, 4, stride=2, padding=1, bias=not normed)
            dropped = dropout and level >= max(levels - DROPPED_LAYERS, 1)
            extras = [*([instance_norm(after)] if normed else []), *([Dropout(0.5)] if dropped else [])]
            self.decoder.append(nn.Sequential(up, *extras))
        self.last = nn.Conv2d(last, outputs, 3, padding=1) if full_resolution_stage else None

    def forward(self, ideal: Tensor) -> Tensor:
        """A change ``(B, outputs, h, w)`` of an ideal intensity ``(B, inputs, h, w)``."""
        x = pad_to_multiple(ideal, 2**self.levels).contiguous(memory_format=torch.channels_last)
        taken = []
        for encode in self.encoder:
            features = encode(x)
            x = functional.leaky_relu(features, SLOPE)
            taken.append(x if self.skip_after_activation else functional.relu(features))
        x = taken.pop()
        for decode in self.decoder:
            x = decode(x)
            if taken:
                x = torch.cat([functional.relu(x), taken.pop()], dim=1)
        if self.last is not None:
            x = self.last(functional.relu(x))
        return crop_to(x, *ideal.shape[-2:])
