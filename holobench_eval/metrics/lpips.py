"""Learned perceptual image patch similarity, for those who have the weights of its trunk.

R. Zhang, P. Isola, A. A. Efros, E. Shechtman, O. Wang, "The unreasonable effectiveness of deep features as a
perceptual metric", CVPR (2018), version 0.1. The learned heads ship inside torchmetrics; the ImageNet trunk is in no
package and is read from torchvision's published file.
"""

from __future__ import annotations

import importlib.util
import os
import pickle
from dataclasses import dataclass
from functools import lru_cache, partial
from pathlib import Path
from typing import Literal

import torch
from torch import Tensor, nn

from ..core.errors import UserError
from .base import Metric, as_rgb, paired

Network = Literal["alex", "vgg"]
SMALLEST_LPIPS = 32

# Mean and deviation of ImageNet for images in [-1, 1], as in the authors' release.
SHIFT = (-0.030, -0.088, -0.188)
SCALE = (0.458, 0.448, 0.450)


@dataclass(frozen=True)
class _Trunk:
    """How torchvision names and publishes a network, and the layers (after a ReLU) whose output is compared."""

    stem: str
    url: str
    taps: tuple[int, ...]


_TRUNKS: dict[Network, _Trunk] = {
    "alex": _Trunk("alexnet", "https://download.pytorch.org/models/alexnet-owt-7be5be79.pth", (1, 4, 7, 9, 11)),
    "vgg": _Trunk("vgg16", "https://download.pytorch.org/models/vgg16-397923af.pth", (3, 8, 15, 22, 29)),
}


def _alexnet() -> nn.Sequential:
    return nn.Sequential(
        *(nn.Conv2d(3, 64, 11, stride=4, padding=2), nn.ReLU(), nn.MaxPool2d(3, 2)),
        *(nn.Conv2d(64, 192, 5, padding=2), nn.ReLU(), nn.MaxPool2d(3, 2)),
        *(nn.Conv2d(192, 384, 3, padding=1), nn.ReLU()),
        *(nn.Conv2d(384, 256, 3, padding=1), nn.ReLU()),
        *(nn.Conv2d(256, 256, 3, padding=1), nn.ReLU()),
    )


def _vgg16() -> nn.Sequential:
    layers: list[nn.Module] = []
    before = 3
    for block, (width, repeats) in enumerate(((64, 2), (128, 2), (256, 3), (512, 3), (512, 3))):
        if block:
            layers.append(nn.MaxPool2d(2))
        for _ in range(repeats):
            layers += [nn.Conv2d(before, width, 3, padding=1), nn.ReLU()]
            before = width
    return nn.Sequential(*layers)


def _heads_file(network: Network) -> Path | None:
    spec = importlib.util.find_spec("torchmetrics")
    if spec is None or spec.origin is None:
        return None
    return Path(spec.origin).parent / "functional" / "image" / "lpips_models" / f"{network}.pth"


def _hub() -> Path:
    """Torch's hub cache, by its rules, for a process without torch."""
    home = os.environ.get("TORCH_HOME") or Path(os.environ.get("XDG_CACHE_HOME") or "~/.cache", "torch")
    return Path(home).expanduser() / "hub" / "checkpoints"


def find_weights(network: Network, location: Path | None = None) -> Path | None:
    """The trunk's file: ``location`` or the newest match in it, or in torch's hub cache; None where there is none.

    location: a ``.pth`` file named like torchvision's (``alexnet*``, ``vgg16*``) or a folder of such files.
    Raises UserError when ``location`` is given and does not exist, or is a file of another name.
    """
    stem = _TRUNKS[network].stem
    if location is None:
        folder = _hub()
    elif location.is_file():
        if not location.name.startswith(tuple(trunk.stem for trunk in _TRUNKS.values())):
            raise UserError(f"LPIPS weights: {location} must be named alexnet*.pth or vgg16*.pth, as torchvision does")
        return location if location.name.startswith(stem) else None
    elif location.is_dir():
        folder = location
    else:
        raise UserError(f"LPIPS weights: no such file or folder: {location}")
    return max(folder.glob(f"{stem}-*.pth"), key=lambda path: path.stat().st_mtime, default=None)


def available(network: Network = "alex", location: Path | None = None) -> str | None:
    """None when LPIPS can be computed with this network, else one line: what is missing and where to get it."""
    heads = _heads_file(network)
    if heads is None or not heads.is_file():
        return "the linear heads are missing; install torchmetrics"
    if find_weights(network, location) is None:
        target = location or _hub()
        return f"no trunk weights; put {_TRUNKS[network].url} into {target}"
    return None


def read_weights(path: Path, owner: str = "LPIPS weights") -> dict[str, Tensor]:
    """A dictionary of tensors from a file, read without running anything in it. UserError, which begins with ``owner``,
    for a file that is none."""
    try:
        state = torch.load(path, map_location="cpu", weights_only=True)
    except (pickle.UnpicklingError, RuntimeError, EOFError, OSError, ValueError) as error:
        reason = (str(error).splitlines() or [type(error).__name__])[0]
        raise UserError(f"{owner}: {path} cannot be read as a state dict: {reason}") from error
    if not isinstance(state, dict) or not all(isinstance(value, Tensor) for value in state.values()):
        raise UserError(f"{owner}: {path} is not a state dict of tensors; download it again")
    return state


@lru_cache(maxsize=4)
def _model(network: Network, path: Path, modified: float, device: torch.device) -> tuple[nn.Sequential, list[Tensor]]:
    """Trunk and heads; ``modified`` is the file's time stamp, so that a replaced file is read again."""
    trunk = {"alex": _alexnet, "vgg": _vgg16}[network]()
    prefix = "features."
    features = {key.removeprefix(prefix): value for key, value in read_weights(path).items() if key.startswith(prefix)}
    try:
        trunk.load_state_dict(features)
    except RuntimeError as error:
        stem = _TRUNKS[network].stem
        raise UserError(
            f"LPIPS weights: {path} is not torchvision's state dict of {stem}; download it again"
        ) from error
    if not all(bool(value.isfinite().all()) for value in features.values()):
        raise UserError(f"LPIPS weights: {path} holds values that are not finite; download it again")
    heads_file = _heads_file(network)
    assert heads_file is not None
    stored = read_weights(heads_file)
    heads = [stored[f"lin{k}.model.1.weight"].float().to(device) for k in range(len(_TRUNKS[network].taps))]
    return trunk.float().to(device).eval().requires_grad_(False), heads


def _unit(features: Tensor) -> Tensor:
    """Features divided by their length over channels; the lower bound keeps the gradient finite where all are zero."""
    length = features.square().sum(1, keepdim=True).clamp_min(1e-20).sqrt()
    return features / (length + 1e-10)


def lpips(image: Tensor, target: Tensor, network: Network = "alex", weights: Path | None = None) -> Tensor:
    """LPIPS v0.1: squared differences of unit-length deep features, weighted by the learned heads (Eq. 1 of the paper).

    Computed in float32.

    Parameters
    ----------
    image, target
        ``(C, H, W)`` or ``(B, C, H, W)`` in [0, 1], sRGB encoded, C = 1 or 3, sides of at least 32 px; gray
        is taken as three equal channels.
    network
        Trunk of the features.
    weights
        File or folder of the trunk, by default torch's hub cache; see ``find_weights``.

    Returns
    -------
    Tensor
        Scalar or ``(B,)``; lower is better, identical images give 0.

    Raises
    ------
    ValueError
        Wrong shapes, types or values; see ``base.paired``.
    UserError
        The weights are absent or not what they should be: there is never a value without them.
    """
    x, y = paired(image, target, smallest=SMALLEST_LPIPS)
    reason = available(network, weights)
    path = find_weights(network, weights)
    if reason is not None or path is None:
        raise UserError(f"lpips_{network}: {reason}")
    trunk, heads = _model(network, path, path.stat().st_mtime, image.device)
    shift = torch.tensor(SHIFT, device=image.device).view(3, 1, 1)
    scale = torch.tensor(SCALE, device=image.device).view(3, 1, 1)
    a, b = ((2 * as_rgb(side).float() - 1 - shift) / scale for side in (x, y))
    value = a.new_zeros(a.shape[0])
    pending = iter(heads)
    for index, layer in enumerate(trunk):
        a, b = layer(a), layer(b)
        if index in _TRUNKS[network].taps:
            weighted = (_unit(a) - _unit(b)).square() * next(pending)
            value = value + weighted.sum(1).mean(dim=(1, 2))
    return value.to(image.dtype).reshape(image.shape[:-3])


def lpips_metric(network: Network, weights: Path | None = None) -> Metric:
    """LPIPS with one network as a Metric, reported as ``lpips_alex`` or ``lpips_vgg``."""
    return Metric(
        name=f"lpips_{network}",
        version="0.1",
        direction="lower",
        best=0.0,
        domains=("srgb",),
        function=partial(lpips, network=network, weights=weights),
        smallest=SMALLEST_LPIPS,
        available=partial(available, network, weights),
        title={"alex": "LPIPS (AlexNet)", "vgg": "LPIPS (VGG)"}[network],
    )
