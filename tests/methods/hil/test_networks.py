"""Networks have the sizes and layers that were published, for any size of image, and what cannot be made is refused."""

import math
from typing import Any

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from torch import Tensor, nn

from holobench_eval.core.errors import UserError
from holobench_eval.methods.hil.baselines import Identity, Pix2Pix, Pix2PixHD, UNet
from holobench_eval.methods.hil.discriminator import MultiScaleDiscriminator, PatchDiscriminator
from holobench_eval.methods.hil.generator import Generator, crop_to, pad_to_multiple
from holobench_eval.methods.hil.networks import FromIdentity, Network
from tests.support import toy_camera


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
def test_every_name_makes_its_networks_with_the_published_filters(name, kind, judge, filters) -> None:
    generator, discriminator = on_meta(name=name, preset="paper")
    assert isinstance(generator, kind)
    assert isinstance(discriminator, judge)
    assert first_filters(generator) == filters == Network(name, preset="paper").filters
    assert discriminator is None or first_filters(discriminator) == filters
    assert first_filters(on_meta(name=name)[0]) == filters // 4


def test_levels_and_width_replace_those_of_the_preset() -> None:
    settings = ({"levels": 3, "width": 10}, {"preset": "paper"}, {"name": "unet", "preset": "paper"})
    given, paper, unet = (on_meta(**params)[0] for params in settings)
    assert (given.levels, first_filters(given)) == (3, 10)
    assert (paper.levels, unet.levels) == (8, 4)


def test_switches_reach_the_generator_and_the_discriminator() -> None:
    plain, seen = on_meta()
    assert seen.condition == 3
    _, unseen = on_meta(conditional=False)
    assert unseen.condition == 0
    for switch, value in {"dropout": True, "full_resolution_stage": False, "plain_ends": False}.items():
        assert str(on_meta(**{switch: value})[0]) != str(plain)
    assert plain.skip_after_activation
    assert not on_meta(skip_after_activation=False)[0].skip_after_activation


def test_a_switch_of_the_proposed_network_is_refused_for_another_and_uneven_channels_for_the_identity() -> None:
    for switch in ("conditional", "full_resolution_stage", "plain_ends", "skip_after_activation"):
        with pytest.raises(UserError, match=f"network 'unet' has no '{switch}'"):
            Network("unet", **{switch: False})
        Network("unet", **{switch: True})
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


def test_the_first_weights_of_unet_keep_the_size_of_the_signal_and_weights_lie_channels_last() -> None:
    torch.manual_seed(0)
    values = [value for value in Network().generator(3, 3).parameters() if value.ndim == 4]
    assert all(value.is_contiguous(memory_format=torch.channels_last) for value in values)
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
    image = toy_camera.picture()[None]
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


def small(**options: bool) -> Generator:
    torch.manual_seed(0)
    return Generator(3, 3, levels=4, width=4, **options)


def kinds(module: nn.Module, kind: type[nn.Module]) -> list[str]:
    return [name for name, layer in module.named_modules() if isinstance(layer, kind)]


def picture(height: int = 40, width: int = 40, channels: int = 3) -> Tensor:
    return torch.rand(1, channels, height, width, generator=torch.Generator().manual_seed(1))


@given(st.integers(1, 70), st.integers(1, 70), st.sampled_from([1, 8, 32]))
def test_padding_is_zero_centred_and_undone_by_cropping(height: int, width: int, multiple: int) -> None:
    image = 1 + picture(height, width)
    padded = pad_to_multiple(image, multiple)
    for before, after in zip(image.shape[-2:], padded.shape[-2:], strict=True):
        assert after % multiple == 0
        assert 0 <= after - before < multiple
    assert torch.equal(crop_to(padded, height, width), image)
    assert float(padded.sum()) == pytest.approx(float(image.sum()), rel=1e-5)


def test_the_paper_size_has_eight_levels_64_filters_and_pads_to_1280_x_2048() -> None:
    seen: list[tuple[int, ...]] = []
    with torch.device("meta"):
        generator = Generator(3, 3)
        generator.encoder[0].register_forward_pre_hook(lambda _, args: seen.append(tuple(args[0].shape)))
        generator.last.register_forward_pre_hook(lambda _, args: seen.append(tuple(args[0].shape)))
        assert generator(torch.empty(1, 3, 1080, 1920)).shape == (1, 3, 1080, 1920)
    assert seen == [(1, 3, 1280, 2048), (1, 32, 1280, 2048)]
    down = [layer for layer in generator.encoder.modules() if isinstance(layer, nn.Conv2d)]
    up = [layer for layer in generator.decoder.modules() if isinstance(layer, nn.ConvTranspose2d)]
    assert [layer.out_channels for layer in down] == [64, 128, 256, 512, 512, 512, 512, 512]
    assert [layer.out_channels for layer in up] == [512, 512, 512, 512, 256, 128, 64, 32]
    assert {(layer.kernel_size, layer.stride) for layer in down} == {((5, 5), (2, 2))}
    assert {(layer.kernel_size, layer.stride) for layer in up} == {((4, 4), (2, 2))}
    assert generator.last.stride == (1, 1)
    assert not kinds(generator, nn.Dropout)
    # the ends have no normalisation
    assert kinds(generator.encoder, nn.InstanceNorm2d) == [f"{level}.1" for level in (2, 3, 4, 5, 6)]
    assert kinds(generator.decoder, nn.InstanceNorm2d) == [f"{layer}.1" for layer in range(6)]


def test_without_plain_ends_there_are_three_normalisations_more_and_nothing_else() -> None:
    changed, plain = small(plain_ends=False), small()
    more = set(kinds(changed, nn.InstanceNorm2d)) - set(kinds(plain, nn.InstanceNorm2d))
    assert more == {"encoder.1.1", "decoder.2.1", "decoder.3.1"}
    assert weights(changed) == weights(plain)


def test_without_the_full_resolution_stage_the_last_transposed_convolution_makes_the_image() -> None:
    changed, plain = small(full_resolution_stage=False), small()
    assert changed.last is None
    name = "decoder.3.0.weight"
    assert weights(changed)[name] == (8, 3, 4, 4)
    rest = {key: shape for key, shape in weights(plain).items() if key not in (name, "last.weight")}
    assert {key: shape for key, shape in weights(changed).items() if key != name} == rest
    assert kinds(changed, nn.InstanceNorm2d) == kinds(plain, nn.InstanceNorm2d)


def test_dropout_is_in_the_three_innermost_decoding_layers_and_only_while_training() -> None:
    changed, plain = small(dropout=True), small()
    assert kinds(changed, nn.Dropout) == ["decoder.0.2", "decoder.1.2", "decoder.2.1"]
    changed.load_state_dict(plain.state_dict())
    assert torch.equal(changed.eval()(picture()), plain(picture()))
    assert not torch.equal(changed.train()(picture()), plain(picture()))


def test_the_skip_connection_branches_off_before_or_after_the_activation() -> None:
    """Where the encoder's features are positive there is no difference; negative ones pass only after LeakyReLU."""
    changed, plain = small(skip_after_activation=False), small()
    assert weights(changed) == weights(plain)
    changed.load_state_dict(plain.state_dict())
    assert not torch.allclose(changed(picture()), plain(picture()))
    for level in range(4):
        layer = plain.encoder[level][-1]
        layer.bias.data += 1000.0  # every feature is positive
        changed.load_state_dict(plain.state_dict())
    assert torch.allclose(changed(picture()), plain(picture()))


def test_the_output_is_linear_in_the_last_layer() -> None:
    """No activation at the end: the image is as bright as the last convolution makes it."""
    generator = small()
    before = generator(picture())
    for parameter in generator.last.parameters():
        parameter.data *= -1000
    assert torch.allclose(generator(picture()), -1000 * before, rtol=1e-4, atol=1e-3)
    assert float(generator(picture()).detach().abs().max()) > 2


def weights(generator: Generator) -> dict[str, tuple[int, ...]]:
    """Shapes of the convolutions' weights."""
    return {name: tuple(value.shape) for name, value in generator.named_parameters() if value.ndim == 4}


SMALL = {
    "proposed": lambda: Generator(3, 3, levels=4, width=4),
    "unet": lambda: UNet(3, 3, levels=2, width=4),
    "pix2pix": lambda: Pix2Pix(3, 3, levels=4, width=4),
    "pix2pixhd": lambda: Pix2PixHD(3, 3, levels=3, width=4, blocks=2),
    "identity": Identity,
}


@pytest.mark.parametrize("name", SMALL)
def test_any_size_comes_out_as_it_went_in(name: str) -> None:
    for size in ((1, 1), (16, 16), (9, 16), (17, 31), (33, 80)):
        predicted = SMALL[name]()(2 * picture(*size))
        assert predicted.shape == (1, 3, *size)
        assert predicted.isfinite().all()


@pytest.mark.parametrize("channels", [(1, 1), (4, 3)])
def test_the_proposed_network_takes_and_makes_any_number_of_channels(channels: tuple[int, int]) -> None:
    generator = Generator(*channels, levels=4, width=4)
    assert generator(picture(17, 31, channels[0])).shape == (1, channels[1], 17, 31)


@pytest.mark.parametrize(
    ("network", "millions", "apart"),
    [
        (lambda: Pix2Pix(3, 3), 54.414, 0.054),  # as the authors' programs print
        (lambda: Pix2PixHD(3, 3), 182.546, 0.18),
        (lambda: UNet(1, 2), 31.031, 0.031),
        (lambda: PatchDiscriminator(3, 3, flat=2), 2.769, 0.0005),  # of pix2pix
    ],
)
def test_the_published_sizes_have_as_many_parameters_as_published(
    network: type[nn.Module], millions: float, apart: float
) -> None:
    with torch.device("meta"):
        module = network()
    count = sum(value.numel() for value in module.parameters())
    assert count / 1e6 == pytest.approx(millions, abs=apart)


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
    parts = [[type(part).__name__ for part in layer[1:]] for layer in module.decoder]
    assert parts == [*[["InstanceNorm2d", "Dropout"]] * 3, *[["InstanceNorm2d"]] * 4, []]
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
    change = module(2 * picture(48, 48)).detach()
    assert -1 <= float(change.min()) < -0.9
    assert 0.9 < float(change.max()) <= 1


def image(size: int = 64, seed: int = 0) -> Tensor:
    return torch.rand(1, 3, size, size, generator=torch.Generator().manual_seed(seed))


def patch(discriminator: PatchDiscriminator, size: int = 256) -> tuple[int, int]:
    """Rows and columns on which one logit depends through the convolutions."""
    for layer in discriminator.layers:
        if len(layer) > 1:
            layer[1] = nn.Identity()  # its mean is over the whole image
    shown = image(size).requires_grad_()
    logits = discriminator(shown, shown.detach())
    middle = logits.shape[-1] // 2
    (slope,) = torch.autograd.grad(logits[0, 0, middle, middle], shown)
    touched = slope.abs().sum(dim=(0, 1)) > 0
    return int(touched.any(dim=1).sum()), int(touched.any(dim=0).sum())


@pytest.mark.parametrize(("flat", "size"), [(3, 94), (2, 70)])
def test_the_patches_have_94_px_and_those_of_pix2pix_70(flat: int, size: int) -> None:
    torch.manual_seed(0)
    assert patch(PatchDiscriminator(3, 3, width=4, flat=flat)) == (size, size)


def test_three_convolutions_have_stride_two_and_three_stride_one() -> None:
    with torch.device("meta"):
        discriminator = PatchDiscriminator(3, 3)
    convolutions = [layer for layer in discriminator.modules() if isinstance(layer, nn.Conv2d)]
    assert [layer.stride[0] for layer in convolutions] == [2, 2, 2, 1, 1, 1]
    assert [layer.in_channels for layer in convolutions] == [6, 64, 128, 256, 512, 512]
    assert convolutions[-1].out_channels == 1
    assert [len(layer) for layer in discriminator.layers] == [1, 2, 2, 2, 2, 1]


@pytest.mark.parametrize("kind", [PatchDiscriminator, MultiScaleDiscriminator])
def test_only_a_conditional_discriminator_sees_the_ideal_image(kind: Any) -> None:
    for condition in (0, 3):
        discriminator = kind(3, condition, width=4)
        verdicts = [discriminator(image(96), image(96, seed)) for seed in (1, 2)]
        assert torch.equal(*verdicts) == (condition == 0)
        assert not torch.allclose(discriminator(image(96, 3), image(96, 1)), verdicts[0])


@pytest.mark.parametrize(
    ("discriminator", "smallest"),
    [
        (PatchDiscriminator(3, 3, width=4), 32),
        (PatchDiscriminator(3, 3, width=4, flat=2), 24),
        (MultiScaleDiscriminator(3, 3, width=4), 93),
    ],
)
def test_the_smallest_image_leaves_one_patch_and_a_smaller_one_is_refused(discriminator: Any, smallest: int) -> None:
    assert discriminator.judge(image(smallest), image(smallest))[-1][-1].shape == (1, 1, 1, 1)
    with pytest.raises(UserError, match=f"at least {smallest} x {smallest} px, got {smallest - 1} x {smallest - 1}"):
        discriminator(image(smallest - 1), image(smallest - 1))


def test_every_scale_judges_with_its_own_weights_at_half_the_size() -> None:
    torch.manual_seed(0)
    discriminator = MultiScaleDiscriminator(3, 3, width=4)
    judged = discriminator.judge(image(160), image(160, 1))
    assert [scale[0].shape[-1] for scale in judged] == [80, 40, 20]
    assert [len(scale) for scale in judged] == [5, 5, 5]
    assert discriminator(image(160), image(160, 1)).shape == (1, sum(scale[-1].numel() for scale in judged))
    first = [scale.layers[0][0].weight for scale in discriminator.scales]
    assert not torch.equal(first[0], first[1])


def test_a_constant_image_is_the_same_at_every_scale() -> None:
    """The average at the edge is over the pixels that are there."""
    torch.manual_seed(0)
    discriminator = MultiScaleDiscriminator(1, 0, width=4)
    discriminator.scales[1].load_state_dict(discriminator.scales[0].state_dict())
    gray = torch.full((1, 1, 160, 160), 0.3)
    fine, coarse, _ = discriminator.judge(gray, gray)
    assert torch.allclose(fine[0][..., 1:-1, 1:-1][..., :10, :10], coarse[0][..., 1:-1, 1:-1][..., :10, :10])
    assert torch.allclose(fine[0][..., :3, :3], coarse[0][..., :3, :3])
