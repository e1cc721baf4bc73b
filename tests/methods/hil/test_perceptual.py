"""The perceptual loss equals Eq. 21, with weights that are read with care and without weights too."""

from __future__ import annotations

import hashlib
from pathlib import Path

import pytest
import torch
from torch import Tensor
from torch.nn import functional

from holobench_eval.core.errors import UserError
from holobench_eval.methods.hil.perceptual import VGG19, OrientedFilters, find_weights, perceptual_loss
from holobench_eval.metrics.base import gaussian_blur
from holobench_eval.metrics.feature_distance import opponent_channels, oriented_responses

LAYERS = {0: (3, 64), 2: (64, 64), 5: (64, 128), 7: (128, 128), 10: (128, 256)}


def images(channels: int = 3, size: int = 24) -> tuple[Tensor, Tensor]:
    draw = torch.Generator().manual_seed(2)
    one, other = torch.rand(2, 2, channels, size, size, generator=draw)
    return one, other


@pytest.fixture(scope="module")
def vgg(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A file such as torchvision's, with random weights and a layer more than is needed."""
    draw, state = torch.Generator().manual_seed(3), {}
    for number, (before, after) in LAYERS.items():
        weight = torch.randn(after, before, 3, 3, generator=draw) * (2 / (9 * before)) ** 0.5
        state[f"features.{number}.weight"] = weight
        state[f"features.{number}.bias"] = torch.randn(after, generator=draw) / 10
    path = tmp_path_factory.mktemp("weights") / "vgg19-made.pth"
    torch.save(state, path)
    return path


def expected(path: Path, image: Tensor, target: Tensor) -> float:
    state = torch.load(path, weights_only=True)
    mean, deviation = torch.tensor([0.485, 0.456, 0.406]), torch.tensor([0.229, 0.224, 0.225])

    def layer(x: Tensor, number: int) -> Tensor:
        return functional.relu(
            functional.conv2d(x, state[f"features.{number}.weight"], state[f"features.{number}.bias"], padding=1)
        )

    def features(x: Tensor) -> tuple[Tensor, Tensor]:
        x = (x.expand(-1, 3, -1, -1) - mean[:, None, None]) / deviation[:, None, None]
        relu1_2 = layer(layer(x, 0), 2)
        return relu1_2, layer(layer(functional.max_pool2d(relu1_2, 2, 2), 5), 7)

    (a1, a2), (b1, b2) = features(image), features(target)
    return float(1.5 * (a1 - b1).abs().mean() + 1.0 * (a2 - b2).abs().mean())


@pytest.mark.parametrize("channels", [1, 3])
def test_vgg_equals_the_formula(vgg: Path, channels: int) -> None:
    image, target = images(channels)
    loss = VGG19(vgg)
    assert loss.name == "vgg19"
    assert float(loss(image, target)) == pytest.approx(expected(vgg, image, target), rel=1e-5)
    assert float(loss(image, target)) > 0.01


@pytest.mark.parametrize("channels", [1, 3])
def test_oriented_filters_equal_the_difference_of_rectified_features(channels: int) -> None:
    image, target = images(channels)
    total, a, b = 0.0, image, target
    for scale, weight in enumerate((1.5, 1.0)):
        mine, theirs = (oriented_responses(opponent_channels(x, scale)) for x in (a, b))
        for sign in (1, -1):
            total += weight * float(((sign * mine).clamp_min(0) - (sign * theirs).clamp_min(0)).abs().mean())
        a, b = (gaussian_blur(x, 1.0)[:, :, ::2, ::2] for x in (a, b))
    loss = OrientedFilters()
    assert loss.name == "oriented filters"
    assert float(loss(image, target)) == pytest.approx(total, rel=1e-5)


def test_identical_images_have_no_loss_and_the_loss_pulls_towards_the_target(vgg: Path) -> None:
    image, target = images()
    for loss in (OrientedFilters(), VGG19(vgg)):
        assert float(loss(target, target)) == 0
        moving = image.clone().requires_grad_()
        before = loss(moving, target)
        (slope,) = torch.autograd.grad(before, moving)
        assert slope.isfinite().all()
        assert float(loss(image - 1e-2 * slope / slope.abs().max(), target)) < float(before.detach())
        assert not any(value.requires_grad for value in loss.parameters())


def test_vgg_is_used_where_its_weights_are_in_the_hub_cache(
    vgg: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(torch.hub, "get_dir", lambda: str(tmp_path))
    assert find_weights() is None
    assert perceptual_loss().name == "oriented filters"
    (tmp_path / "checkpoints").mkdir()
    (tmp_path / "checkpoints" / vgg.name).symlink_to(vgg)
    assert perceptual_loss().name == "vgg19"


def test_a_bad_file_is_refused_in_one_line(vgg: Path, tmp_path: Path) -> None:
    path, state = tmp_path / "vgg19-bad.pth", torch.load(vgg, weights_only=True)
    fewer = {key: value for key, value in state.items() if ".7." not in key}
    other = state | {"features.2.weight": torch.zeros(64, 64, 1, 1)}
    infinite = state | {"features.5.bias": torch.full((128,), torch.nan)}
    # no checkpoint at all, and a pickled object: loading it would run code
    for content in (b"<html>404</html>", [1, 2], fewer, other, infinite, torch.nn.Linear(2, 2)):
        path.write_bytes(content) if isinstance(content, bytes) else torch.save(content, path)
        with pytest.raises(UserError) as caught:
            VGG19(path)
        assert "\n" not in str(caught.value)
        assert str(path) in str(caught.value)


def test_the_checksum_in_a_name_is_checked(vgg: Path, tmp_path: Path) -> None:
    content = vgg.read_bytes()
    right = tmp_path / f"vgg19-{hashlib.sha256(content).hexdigest()[:8]}.pth"
    wrong = tmp_path / "vgg19-01234567.pth"
    for path in (right, wrong):
        path.write_bytes(content)
    assert VGG19(right).name == "vgg19"
    with pytest.raises(UserError, match="checksum"):
        VGG19(wrong)
