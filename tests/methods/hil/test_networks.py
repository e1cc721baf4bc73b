"""A network's parameters make the modules they say, and what cannot be made is refused in a line."""

from __future__ import annotations

import math
from typing import Any

import pytest
import torch
from torch import Tensor, nn

from holobench_eval.core.errors import UserError
from holobench_eval.methods.hil.baselines import Pix2Pix, Pix2PixHD, UNet
from holobench_eval.methods.hil.discriminator import MultiScaleDiscriminator, PatchDiscriminator
from holobench_eval.methods.hil.generator import Generator
from holobench_eval.methods.hil.networks import FromIdentity, Network
from tests.support.toy_camera import picture


def on_meta(**params: Any) -> tuple[nn.Module, nn.Module | None]:
    network = Network(**params)
    with torch.device("meta"):
        return network.generator(3, 3), network.discriminator(3)


def first_filters(module: nn.Module) -> int:
    return next(layer.out_channels for layer in module.modules() if isinstance(layer, nn.Conv2d))


@pytest.mark.parametrize(
    ("name", "kind", "judge", "filters"),
    [
        ("proposed", Generator, PatchDiscriminator, 64),
        ("pix2pix", Pix2Pix, PatchDiscriminator, 64),
        ("unet", UNet, type(None), 32),
        ("pix2pixhd", Pix2PixHD, MultiScaleDiscriminator, 32),
    ],
)
def test_every_name_makes_its_networks_and_the_paper_preset_has_the_published_filters_halved_for_unet_and_pix2pixhd(
    name: Any, kind: type[nn.Module], judge: type[nn.Module], filters: int
) -> None:
    generator, discriminator = on_meta(name=name, preset="paper")
    assert isinstance(generator, kind)
    assert isinstance(discriminator, judge)
    assert first_filters(generator) == filters == Network(name, preset="paper").filters
    assert discriminator is None or first_filters(discriminator) == filters
    assert first_filters(on_meta(name=name)[0]) == filters // 4


def test_levels_and_width_replace_those_of_the_preset() -> None:
    generator, _ = on_meta(levels=3, width=10)
    assert generator.levels == 3
    assert first_filters(generator) == 10
    paper, _ = on_meta(preset="paper")
    assert paper.levels == 8
    unet, _ = on_meta(name="unet", preset="paper")
    assert unet.levels == 4


def test_switches_reach_the_generator_and_the_discriminator() -> None:
    plain, seen = on_meta()
    assert seen.condition == 3
    _, unseen = on_meta(conditional=False)
    assert unseen.condition == 0
    for switch, value in {"dropout": True, "full_resolution_stage": False, "plain_ends": False}.items():
        assert str(on_meta(**{switch: value})[0]) != str(plain)
    assert plain.skip_after_activation
    assert not on_meta(skip_after_activation=False)[0].skip_after_activation


@pytest.mark.parametrize("switch", ["conditional", "full_resolution_stage", "plain_ends", "skip_after_activation"])
def test_a_switch_of_the_proposed_network_is_refused_for_another(switch: str) -> None:
    with pytest.raises(UserError, match=f"network 'unet' has no '{switch}'"):
        Network("unet", **{switch: False})
    Network("unet", **{switch: True})


def test_the_identity_needs_as_many_inputs_as_outputs() -> None:
    with pytest.raises(UserError, match="got 4 and 3"):
        Network("identity").generator(4, 3)


@pytest.mark.parametrize("name", ["proposed", "pix2pix", "pix2pixhd"])
def test_first_weights_have_a_deviation_of_a_fiftieth(name: Any) -> None:
    torch.manual_seed(0)
    network = Network(name)
    for module in (network.generator(3, 3), network.discriminator(3)):
        weights = [value for value in module.parameters() if value.ndim == 4]
        flat = torch.cat([weight.flatten() for weight in weights]).detach()
        assert float(flat.std()) == pytest.approx(0.02, rel=0.01)
        assert abs(float(flat.mean())) < 1e-4


def test_the_first_weights_of_unet_keep_the_size_of_the_signal() -> None:
    torch.manual_seed(0)
    for layer in Network("unet").generator(3, 3).modules():
        if isinstance(layer, nn.Conv2d) and layer.in_channels >= 16:
            inputs = layer.in_channels * math.prod(layer.kernel_size)
            assert float(layer.weight.detach().std()) == pytest.approx(math.sqrt(2 / inputs), rel=0.05)


class Constant(nn.Module):
    """A network that gives one value everywhere."""

    def __init__(self, value: float) -> None:
        super().__init__()
        self.last = nn.Conv2d(1, 1, 1)
        self.value = value

    def forward(self, ideal: Tensor) -> Tensor:
        return self.last(ideal) + self.value


def test_a_fresh_network_is_the_identity_and_learns() -> None:
    image = picture()[None]
    with torch.random.fork_rng():
        torch.manual_seed(0)
        network = FromIdentity(Network(levels=2, width=4).generator(2, 2))
    assert torch.equal(network(image), image)
    optimiser = torch.optim.Adam(network.parameters(), lr=1e-2)
    losses = []
    for _ in range(60):
        losses.append((network(image) - (1 - image)).abs().mean())
        optimiser.zero_grad()
        losses[-1].backward()
        optimiser.step()
    assert losses[-1] < 0.5 * losses[0]


def test_a_prediction_is_never_negative_and_has_a_gradient_where_it_is_cut() -> None:
    ideal = torch.linspace(0, 1, 16).reshape(1, 1, 4, 4).requires_grad_()
    light = FromIdentity(Constant(-0.5))(ideal)
    assert torch.equal(light, (ideal - 0.5).clamp_min(0))
    assert float((light == 0).float().mean()) == 0.5
    light.sum().backward()
    assert torch.equal(ideal.grad, torch.ones_like(ideal))


def test_weights_lie_channels_last() -> None:
    generator = Network().generator(3, 3)
    assert all(
        value.is_contiguous(memory_format=torch.channels_last) for value in generator.parameters() if value.ndim == 4
    )
