"""Photographs and a stand-in for the LPIPS trunk, for the metric tests."""

from collections.abc import Callable
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
import skimage.data
import torch
from skimage.transform import resize
from torch import Tensor

Photograph = Callable[..., Tensor]


@lru_cache(maxsize=32)
def _photograph(name: str, side: int, channels: int) -> Tensor:
    image = np.asarray(getattr(skimage.data, name)()) / 255
    image = image if image.ndim == 3 else np.repeat(image[..., None], 3, axis=2)
    square = min(image.shape[:2])
    top, left = (image.shape[0] - square) // 2, (image.shape[1] - square) // 2
    small = resize(image[top : top + square, left : left + square, :3], (side, side), anti_aliasing=True)
    return torch.from_numpy(np.moveaxis(small, -1, 0)[:channels].copy()).clamp(0, 1)


@pytest.fixture(scope="session")
def photograph() -> Photograph:
    """``photograph(name, side=192, channels=3)``: a scikit-image picture (C, side, side), float64 in [0, 1]."""

    def load(name: str, side: int = 192, channels: int = 3) -> Tensor:
        return _photograph(name, side, channels).clone()

    return load


@pytest.fixture(scope="session")
def random_alexnet(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A file of torchvision's layout and name for AlexNet, with random weights."""
    generator = torch.Generator().manual_seed(3)
    state = {}
    for index, (out, into, size) in {
        0: (64, 3, 11),
        3: (192, 64, 5),
        6: (384, 192, 3),
        8: (256, 384, 3),
        10: (256, 256, 3),
    }.items():
        scale = (2 / (into * size**2)) ** 0.5
        state[f"features.{index}.weight"] = scale * torch.randn(out, into, size, size, generator=generator)
        state[f"features.{index}.bias"] = 0.1 * torch.randn(out, generator=generator)
    state["classifier.1.bias"] = torch.zeros(4096)
    path = tmp_path_factory.mktemp("weights") / "alexnet-owt-random.pth"
    torch.save(state, path)
    return path
