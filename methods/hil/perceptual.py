"""Perceptual loss: differences of the features of two images.

Chakravarthula et al. 2020, Eq. 21, after Johnson, Alahi & Fei-Fei, "Perceptual losses for real-time style transfer and
super-resolution", ECCV (2016). The features are those of VGG-19 where its ImageNet weights are found, which are in no
package, and else those of fixed filters.
"""

from __future__ import annotations

import re
from pathlib import Path

import torch
from torch import Tensor, nn
from torch.nn import functional

from ...core.errors import UserError
from ...core.hashing import file_digest
from ...metrics.base import as_rgb, gaussian_blur
from ...metrics.feature_distance import opponent_channels, oriented_responses
from ...metrics.lpips import read_weights

WEIGHTS = (1.5, 1.0)  # v of relu1_2 and relu2_2, Section 4.3.1
URL = "https://download.pytorch.org/models/vgg19-dcbb9e9d.pth"

# Mean and deviation of ImageNet, for images in [0, 1] (torchvision).
MEAN = (0.485, 0.456, 0.406)
DEVIATION = (0.229, 0.224, 0.225)

CONVOLUTIONS = {"0": (3, 64), "2": (64, 64), "5": (64, 128), "7": (128, 128)}  # torchvision's numbers: channels
POOLED = "5"  # the convolution after the first max pooling
COMPARED = ("2", "7")  # their ReLUs are relu1_2 and relu2_2


class VGG19(nn.Module):
    """Eq. 21 on relu1_2 and relu2_2 of VGG-19, as published by torchvision in ``path`` (``vgg19-*.pth``).

    Linear light is taken as it comes, gray as three equal channels, and brought to ImageNet's mean and deviation; the
    norm is the mean absolute value, so that the weights of Eq. 20 do not depend on the image's size (the paper says
    neither). Raises UserError for a file that is not what torchvision publishes.
    """

    name = "vgg19"

    def __init__(self, path: Path) -> None:
        super().__init__()
        state = _read_vgg19(path)
        self.convolutions = nn.ModuleDict()
        for number, (before, after) in CONVOLUTIONS.items():
            convolution = nn.Conv2d(before, after, 3, padding=1)
            try:
                convolution.load_state_dict({kind: state[f"features.{number}.{kind}"] for kind in ("weight", "bias")})
            except (KeyError, RuntimeError) as error:
                raise UserError(f"VGG weights: {path} is not torchvision's state dict of vgg19; {_AGAIN}") from error
            if not all(bool(value.isfinite().all()) for value in convolution.parameters()):
                raise UserError(f"VGG weights: {path} holds values that are not finite; {_AGAIN}")
            self.convolutions[number] = convolution
        self.requires_grad_(False)

    def forward(self, image: Tensor, target: Tensor) -> Tensor:
        """The loss, a scalar, of two intensities ``(B, C, h, w)``, C = 1 or 3."""
        pairs = zip(WEIGHTS, self.features(image), self.features(target), strict=True)
        return torch.stack([weight * functional.l1_loss(a, b) for weight, a, b in pairs]).sum()

    def features(self, image: Tensor) -> list[Tensor]:
        """relu1_2 ``(B, 64, h, w)`` and relu2_2 ``(B, 128, h / 2, w / 2)``."""
        mean, deviation = (image.new_tensor(values).view(3, 1, 1) for values in (MEAN, DEVIATION))
        x = ((as_rgb(image) - mean) / deviation).contiguous(memory_format=torch.channels_last)
        features = []
        for number, convolution in self.convolutions.items():
            if number == POOLED:
                x = functional.max_pool2d(x, 2)
            x = functional.relu(convolution(x))
            if number in COMPARED:
                features.append(x)
        return features


class OrientedFilters(nn.Module):
    """Eq. 21 on fixed features: derivatives of Gaussians in four orientations, at full and half resolution.

    The filters of ``metrics.feature_distance``, of luma and at half resolution of two opponent colours as well. Their
    rectified responses are what is compared there; the absolute differences of positive and negative parts add up to
    that of the responses, and the responses are linear, so here the filtered difference of the images is all there is.
    """

    name = "oriented filters"

    def forward(self, image: Tensor, target: Tensor) -> Tensor:
        """The loss, a scalar, of two intensities ``(B, C, h, w)``, C = 1 or 3, with sides of at least 8 px."""
        difference = image - target
        parts = []
        for scale, weight in enumerate(WEIGHTS):
            if scale:
                difference = gaussian_blur(difference, 1.0)[:, :, ::2, ::2]
            parts.append(weight * oriented_responses(opponent_channels(difference, scale)).abs().mean())
        return torch.stack(parts).sum()


Perceptual = VGG19 | OrientedFilters


def perceptual_loss() -> Perceptual:
    """VGG-19 where its weights are found (see ``find_weights``), else the oriented filters; ``name`` says which."""
    path = find_weights()
    return OrientedFilters() if path is None else VGG19(path)


def find_weights() -> Path | None:
    """The newest file ``vgg19-*.pth`` in torch's hub cache, or None."""
    folder = Path(torch.hub.get_dir()) / "checkpoints"
    return max(folder.glob("vgg19-*.pth"), key=lambda path: path.stat().st_mtime, default=None)


_AGAIN = "download it again"


def _read_vgg19(path: Path) -> dict[str, Tensor]:
    """The file's tensors; the eight digits of its SHA-256 in which a name such as torchvision's ends are checked."""
    named = re.search(r"-([0-9a-f]{8})\.pth$", path.name)
    if named and not file_digest(path).startswith(named[1]):
        raise UserError(f"VGG weights: {path} does not have the checksum in its name; {_AGAIN}")
    return read_weights(path, "VGG weights")
