"""The generator has the shapes of the paper, and each of its four changes can be undone by itself."""

from __future__ import annotations

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from torch import Tensor, nn

from holobench_eval.methods.hil.generator import Generator, crop_to, pad_to_multiple


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


@pytest.mark.parametrize("size", [(1, 1), (16, 16), (17, 31), (33, 80)])
@pytest.mark.parametrize("channels", [(3, 3), (1, 1), (4, 3)])
def test_any_size_comes_out_as_it_went_in(size: tuple[int, int], channels: tuple[int, int]) -> None:
    generator = Generator(*channels, levels=4, width=4)
    assert generator(picture(*size, channels=channels[0])).shape == (1, channels[1], *size)


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


def test_the_ends_have_no_normalisation() -> None:
    with torch.device("meta"):
        generator = Generator(3, 3)
    assert kinds(generator.encoder, nn.InstanceNorm2d) == [f"{level}.1" for level in (2, 3, 4, 5, 6)]
    assert kinds(generator.decoder, nn.InstanceNorm2d) == [f"{layer}.1" for layer in range(6)]


def test_without_plain_ends_there_are_three_normalisations_more_and_nothing_else() -> None:
    changed, plain = small(plain_ends=False), small()
    assert set(kinds(changed, nn.InstanceNorm2d)) - set(kinds(plain, nn.InstanceNorm2d)) == {
        "encoder.1.1",
        "decoder.2.1",
        "decoder.3.1",
    }
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
