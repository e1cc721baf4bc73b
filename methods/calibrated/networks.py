"""The small network of the methods that calibrate one."""

from __future__ import annotations

from itertools import pairwise

import torch
from torch import Tensor, nn
from torch.nn import functional

from ..learned.weights import draw_weights, start_at_zero


class ColourByColour(nn.Module):
    """Three convolutions of 3 x 3 px at full resolution with ReLU between them, for each colour weights of its own.

    Images ``(C, inputs, h, w)`` to ``(C, outputs, h, w)``, zeros before it has learned. The position, -1 to 1 on both
    axes, is given too: illumination and shading depend on it, and convolutions do not know it. width: features a
    colour.
    """

    def __init__(self, colours: int, inputs: int, outputs: int, width: int) -> None:
        super().__init__()
        features = [colours * count for count in (inputs + 2, width, width, outputs)]
        first, second, last = (
            nn.Conv2d(before, after, 3, padding=1, groups=colours) for before, after in pairwise(features)
        )
        self.layers = start_at_zero(draw_weights(nn.Sequential(first, nn.ReLU(), second, nn.ReLU(), last), None))

    def forward(self, seen: Tensor) -> Tensor:
        """See the class."""
        colours, _, height, width = seen.shape
        rows = torch.linspace(-1, 1, height, device=seen.device).view(1, 1, -1, 1).expand(colours, 1, height, width)
        columns = torch.linspace(-1, 1, width, device=seen.device).view(1, 1, 1, -1).expand(colours, 1, height, width)
        placed = torch.cat([seen, rows, columns], 1)
        if any(weight.requires_grad for weight in self.layers.parameters()):
            answer: Tensor = self.layers(placed.flatten(0, 1)[None].contiguous(memory_format=torch.channels_last))
            return answer.view(colours, -1, height, width)
        images = placed.contiguous(memory_format=torch.channels_last).split(1)
        for layer in self.layers:  # by groups, a retrieval's convolutions take a CPU twice as long
            if isinstance(layer, nn.Conv2d):
                assert layer.bias is not None
                own = zip(images, layer.weight.chunk(colours), layer.bias.chunk(colours), strict=True)
                images = tuple(functional.conv2d(image, weight, bias, padding=1) for image, weight, bias in own)
            else:
                images = tuple(map(layer, images))
        return torch.cat(images)
