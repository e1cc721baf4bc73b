"""The compared networks are those that were published, for any size of image."""

from __future__ import annotations

import pytest
import torch
from torch import Tensor, nn

from holobench_eval.methods.hil.baselines import Identity, Pix2Pix, Pix2PixHD, UNet

SMALL = {
    "unet": lambda: UNet(3, 3, levels=2, width=4),
    "pix2pix": lambda: Pix2Pix(3, 3, levels=4, width=4),
    "pix2pixhd": lambda: Pix2PixHD(3, 3, levels=3, width=4, blocks=2),
    "identity": Identity,
}


def picture(height: int = 48, width: int = 48) -> Tensor:
    return 2 * torch.rand(1, 3, height, width, generator=torch.Generator().manual_seed(1))


@pytest.mark.parametrize("size", [(1, 1), (9, 16), (17, 31), (33, 80)])
@pytest.mark.parametrize("name", SMALL)
def test_any_size_comes_out_as_it_went_in(name: str, size: tuple[int, int]) -> None:
    predicted = SMALL[name]()(picture(*size))
    assert predicted.shape == (1, 3, *size)
    assert predicted.isfinite().all()


@pytest.mark.parametrize(
    ("network", "millions"),
    [
        (lambda: Pix2Pix(3, 3), 54.414),  # as the authors' programs print
        (lambda: Pix2PixHD(3, 3), 182.546),
        (lambda: UNet(1, 2), 31.031),
    ],
)
def test_the_published_sizes_have_as_many_parameters_as_published(network: type[nn.Module], millions: float) -> None:
    with torch.device("meta"):
        module = network()
    count = sum(value.numel() for value in module.parameters())
    assert count / 1e6 == pytest.approx(millions, rel=1e-3)


def test_unet_has_23_convolutions_and_1024_features_at_the_bottom() -> None:
    with torch.device("meta"):
        module = UNet(1, 2)
    convolutions = [layer for layer in module.modules() if isinstance(layer, nn.Conv2d | nn.ConvTranspose2d)]
    assert len(convolutions) == 23
    assert max(layer.out_channels for layer in convolutions) == 1024
    assert not any(isinstance(layer, nn.InstanceNorm2d) for layer in module.modules())


def test_pix2pix_halves_eight_times_and_has_no_normalisation_at_either_end_or_the_bottom() -> None:
    with torch.device("meta"):
        module = Pix2Pix(3, 3).generator
    assert [len(layer) for layer in module.encoder] == [1, 2, 2, 2, 2, 2, 2, 1]
    assert [[type(part).__name__ for part in layer[1:]] for layer in module.decoder] == [
        *[["InstanceNorm2d", "Dropout"]] * 3,
        *[["InstanceNorm2d"]] * 4,
        [],
    ]
    kernels = {layer.kernel_size for layer in module.modules() if isinstance(layer, nn.Conv2d | nn.ConvTranspose2d)}
    assert kernels == {(4, 4)}


def test_pix2pixhd_has_nine_residual_blocks_at_a_sixteenth_of_the_size() -> None:
    seen: list[tuple[int, ...]] = []
    with torch.device("meta"):
        module = Pix2PixHD(3, 3)
        blocks = [layer for layer in module.layers if type(layer).__name__ == "_Residual"]
        for block in blocks:
            block.register_forward_hook(lambda _, __, made: seen.append(tuple(made.shape)))
        module(torch.empty(1, 3, 512, 1024))
    assert seen == [(1, 1024, 32, 64)] * 9


@pytest.mark.parametrize("name", ["pix2pix", "pix2pixhd"])
def test_a_tanh_keeps_the_change_between_minus_one_and_one(name: str) -> None:
    torch.manual_seed(0)
    module = SMALL[name]()
    for parameter in module.parameters():
        parameter.data *= 30
    change = module(picture()).detach()
    assert -1 <= float(change.min()) < -0.9
    assert 0.9 < float(change.max()) <= 1
