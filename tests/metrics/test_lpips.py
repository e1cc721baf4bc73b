"""LPIPS with a random trunk equals its formula, and without a trunk there is a reason and never a number."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
import torch
import torchmetrics
from torch import Tensor
from torch.nn import functional

from holobench_eval.core.errors import UserError
from holobench_eval.metrics.lpips import available, find_weights, lpips, lpips_metric

Photograph = Callable[..., Tensor]

ALEXNET_CONVOLUTIONS = ((0, 4, 2), (3, 1, 2), (6, 1, 1), (8, 1, 1), (10, 1, 1))
VGG_CONVOLUTIONS = (0, 2, 5, 7, 10, 12, 14, 17, 19, 21, 24, 26, 28)


def heads(network: str) -> list[Tensor]:
    folder = Path(torchmetrics.__file__).parent / "functional" / "image" / "lpips_models"
    stored = torch.load(folder / f"{network}.pth", map_location="cpu", weights_only=True)
    return [stored[f"lin{k}.model.1.weight"].flatten() for k in range(5)]


def scaled(image: Tensor) -> Tensor:
    mean, std = torch.tensor([0.485, 0.456, 0.406]), torch.tensor([0.229, 0.224, 0.225])
    # LPIPS rounds 2 mean - 1 and 2 std to three digits.
    shift, scale = ((2 * mean - 1) * 1000).round() / 1000, ((2 * std) * 1000).round() / 1000
    return ((2 * image.float() - 1) - shift[:, None, None]) / scale[:, None, None]


def alexnet_features(image: Tensor, state: dict[str, Tensor]) -> list[Tensor]:
    x, features = scaled(image)[None], []
    for index, stride, padding in ALEXNET_CONVOLUTIONS:
        if index in (3, 6):
            x = functional.max_pool2d(x, 3, 2)
        weight, bias = state[f"features.{index}.weight"], state[f"features.{index}.bias"]
        x = functional.relu(functional.conv2d(x, weight, bias, stride=stride, padding=padding))
        features.append(x[0])
    return features


def vgg_features(image: Tensor, state: dict[str, Tensor]) -> list[Tensor]:
    x, features = scaled(image)[None], []
    for index in VGG_CONVOLUTIONS:
        if index in (5, 10, 17, 24):
            features.append(x[0])
            x = functional.max_pool2d(x, 2)
        x = functional.relu(
            functional.conv2d(x, state[f"features.{index}.weight"], state[f"features.{index}.bias"], padding=1)
        )
    return [*features, x[0]]


def distance(a: list[Tensor], b: list[Tensor], network: str) -> float:
    total = 0.0
    for x, y, weight in zip(a, b, heads(network), strict=True):
        x, y = x / (x.norm(dim=0) + 1e-10), y / (y.norm(dim=0) + 1e-10)
        total += float(torch.einsum("chw,c->hw", (x - y) ** 2, weight).mean())
    return total


def test_alex_equals_the_formula(photograph: Photograph, random_alexnet: Path) -> None:
    state = torch.load(random_alexnet, weights_only=True)
    image, target = photograph("coffee", 96), photograph("chelsea", 96)
    expected = distance(alexnet_features(image, state), alexnet_features(target, state), "alex")
    assert expected > 0.01
    assert float(lpips(image, target, "alex", random_alexnet)) == pytest.approx(expected, rel=1e-5)


def test_vgg_equals_the_formula(photograph: Photograph, tmp_path: Path) -> None:
    generator = torch.Generator().manual_seed(4)
    state, into = {}, 3
    for index, out in zip(
        VGG_CONVOLUTIONS, (64, 64, 128, 128, 256, 256, 256, 512, 512, 512, 512, 512, 512), strict=True
    ):
        state[f"features.{index}.weight"] = torch.randn(out, into, 3, 3, generator=generator) * (2 / (9 * into)) ** 0.5
        state[f"features.{index}.bias"] = torch.zeros(out)
        into = out
    torch.save(state, tmp_path / "vgg16-random.pth")
    image, target = photograph("coffee", 32), photograph("chelsea", 32)
    expected = distance(vgg_features(image, state), vgg_features(target, state), "vgg")
    assert expected > 0.01
    assert float(lpips(image, target, "vgg", tmp_path)) == pytest.approx(expected, rel=1e-5)


def test_without_weights_there_is_a_reason_and_no_number(
    photograph: Photograph, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(torch.hub, "get_dir", lambda: str(tmp_path))
    reason = available("alex")
    assert "\n" not in reason
    assert "https://download.pytorch.org/models/alexnet-owt-7be5be79.pth" in reason
    assert lpips_metric("vgg").available() is not None
    with pytest.raises(UserError, match="no trunk weights"):
        lpips(photograph("coffee"), photograph("coffee"))


def test_the_hub_cache_is_searched(random_alexnet: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(torch.hub, "get_dir", lambda: str(tmp_path))
    (tmp_path / "checkpoints").mkdir()
    (tmp_path / "checkpoints" / "alexnet-owt-7be5be79.pth").symlink_to(random_alexnet)
    assert available("alex") is None
    assert find_weights("vgg") is None


@pytest.mark.parametrize("content", ["not a checkpoint", "a list", "wrong layers", "nan", "code"])
def test_a_bad_file_is_refused_in_one_line(
    photograph: Photograph, random_alexnet: Path, tmp_path: Path, content: str
) -> None:
    path = tmp_path / "alexnet-bad.pth"
    state = torch.load(random_alexnet, weights_only=True)
    if content == "not a checkpoint":
        path.write_bytes(b"<html>404</html>")
    elif content == "a list":
        torch.save([1, 2], path)
    elif content == "wrong layers":
        torch.save({key: value for key, value in state.items() if "10" not in key}, path)
    elif content == "nan":
        torch.save(state | {"features.0.bias": torch.full((64,), torch.nan)}, path)
    else:
        torch.save(torch.nn.Linear(2, 2), path)  # a pickled object: loading it would run code
    with pytest.raises(UserError) as caught:
        lpips(photograph("coffee", 64), photograph("chelsea", 64), "alex", path)
    assert "\n" not in str(caught.value)
    assert str(path) in str(caught.value)


def test_a_place_that_does_not_exist_or_has_another_name_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="no such file"):
        find_weights("alex", tmp_path / "absent.pth")
    other = tmp_path / "weights.pth"
    other.touch()
    with pytest.raises(UserError, match="must be named"):
        find_weights("alex", other)
