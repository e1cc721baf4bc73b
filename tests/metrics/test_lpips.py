"""LPIPS with a random trunk equals its formula, and without a trunk there is a reason and never a number."""

from collections.abc import Callable
from pathlib import Path

import pytest
import torch
import torchmetrics
from torch import Tensor
from torch.nn import functional

from holobench_eval.core.errors import UserError
from holobench_eval.metrics.lpips import Network, available, find_weights, lpips, lpips_metric

Photograph = Callable[..., Tensor]

VGG = (0, 2, 5, 7, 10, 12, 14, 17, 19, 21, 24, 26, 28)
# By network: stride and padding of its convolutions, those before which it pools and over how many pixels, those whose
# outcome is compared.
TRUNKS = {
    "alex": ({0: (4, 2), 3: (1, 2), 6: (1, 1), 8: (1, 1), 10: (1, 1)}, (3, 6), 3, (0, 3, 6, 8, 10)),
    "vgg": (dict.fromkeys(VGG, (1, 1)), (5, 10, 17, 24), 2, (2, 7, 14, 21, 28)),
}


def heads(network: str) -> list[Tensor]:
    folder = Path(torchmetrics.__file__).parent / "functional" / "image" / "lpips_models"
    stored = torch.load(folder / f"{network}.pth", map_location="cpu", weights_only=True)
    return [stored[f"lin{k}.model.1.weight"].flatten() for k in range(5)]


def scaled(image: Tensor) -> Tensor:
    mean, std = torch.tensor([0.485, 0.456, 0.406]), torch.tensor([0.229, 0.224, 0.225])
    # LPIPS rounds 2 mean - 1 and 2 std to three digits.
    shift, scale = ((2 * mean - 1) * 1000).round() / 1000, ((2 * std) * 1000).round() / 1000
    return ((2 * image.float() - 1) - shift[:, None, None]) / scale[:, None, None]


def features(image: Tensor, state: dict[str, Tensor], network: str) -> list[Tensor]:
    (convolutions, pooled, size, compared), x, found = TRUNKS[network], scaled(image)[None], {}
    for index, (stride, padding) in convolutions.items():
        x = functional.max_pool2d(x, size, 2) if index in pooled else x
        weight, bias = state[f"features.{index}.weight"], state[f"features.{index}.bias"]
        x = functional.relu(functional.conv2d(x, weight, bias, stride=stride, padding=padding))
        found[index] = x[0]
    return [found[index] for index in compared]


def distance(a: list[Tensor], b: list[Tensor], network: str) -> float:
    total = 0.0
    for x, y, weight in zip(a, b, heads(network), strict=True):
        x, y = x / (x.norm(dim=0) + 1e-10), y / (y.norm(dim=0) + 1e-10)
        total += float(torch.einsum("chw,c->hw", (x - y) ** 2, weight).mean())
    return total


def random_vgg(folder: Path) -> Path:
    draw, state, into = torch.Generator().manual_seed(4), {}, 3
    for index, out in zip(VGG, (64, 64, 128, 128, 256, 256, 256, *6 * [512]), strict=True):
        state[f"features.{index}.weight"] = torch.randn(out, into, 3, 3, generator=draw) * (2 / (9 * into)) ** 0.5
        state[f"features.{index}.bias"] = torch.zeros(out)
        into = out
    torch.save(state, folder / "vgg16-random.pth")
    return folder / "vgg16-random.pth"


@pytest.mark.parametrize(("network", "side"), [("alex", 96), ("vgg", 32)])
def test_it_equals_the_formula(photograph, random_alexnet, tmp_path, network: Network, side: int) -> None:
    path = random_alexnet if network == "alex" else random_vgg(tmp_path)
    state = torch.load(path, weights_only=True)
    pair = photograph("coffee", side), photograph("chelsea", side)
    expected = distance(*(features(image, state, network) for image in pair), network)
    assert expected > 0.01
    assert float(lpips(*pair, network, path if network == "alex" else tmp_path)) == pytest.approx(expected, rel=1e-5)


def test_without_weights_there_is_a_reason_and_no_number(photograph, tmp_path, monkeypatch) -> None:
    monkeypatch.setenv("TORCH_HOME", str(tmp_path))
    reason = available("alex")
    assert "\n" not in reason
    assert "https://download.pytorch.org/models/alexnet-owt-7be5be79.pth" in reason
    assert lpips_metric("vgg").available() is not None
    with pytest.raises(UserError, match="no trunk weights"):
        lpips(photograph("coffee"), photograph("coffee"))


def test_the_hub_cache_is_searched_and_other_names_refused(random_alexnet: Path, tmp_path: Path, monkeypatch) -> None:
    for variable, folder in (("TORCH_HOME", tmp_path), ("XDG_CACHE_HOME", tmp_path / "torch")):
        monkeypatch.delenv("TORCH_HOME", raising=False)
        monkeypatch.setenv(variable, str(tmp_path))
        checkpoints = folder / "hub" / "checkpoints"
        assert checkpoints == Path(torch.hub.get_dir()) / "checkpoints"
        checkpoints.mkdir(parents=True)
        (checkpoints / "alexnet-owt-7be5be79.pth").symlink_to(random_alexnet)
        assert available("alex") is None
    assert find_weights("vgg") is None
    with pytest.raises(UserError, match="no such file"):
        find_weights("alex", tmp_path / "absent.pth")
    (tmp_path / "weights.pth").touch()
    with pytest.raises(UserError, match="must be named"):
        find_weights("alex", tmp_path / "weights.pth")


def test_a_bad_file_is_refused_in_one_line(photograph: Photograph, random_alexnet: Path, tmp_path: Path) -> None:
    state = torch.load(random_alexnet, weights_only=True)
    fewer = {key: value for key, value in state.items() if "10" not in key}
    infinite = state | {"features.0.bias": torch.full((64,), torch.nan)}
    # no checkpoint at all, and a pickled object: loading it would run code
    for number, content in enumerate((b"<html>404</html>", [1, 2], fewer, infinite, torch.nn.Linear(2, 2))):
        path = tmp_path / f"alexnet-bad{number}.pth"
        path.write_bytes(content) if isinstance(content, bytes) else torch.save(content, path)
        with pytest.raises(UserError) as caught:
            lpips(photograph("coffee", 64), photograph("chelsea", 64), "alex", path)
        assert "\n" not in str(caught.value)
        assert str(path) in str(caught.value)
