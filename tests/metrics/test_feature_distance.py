"""The feature distance grows with the strength of every distortion, on photographs of different kinds."""

from __future__ import annotations

from collections.abc import Callable

import pytest
import torch
from torch import Tensor

from holobench_eval.metrics.base import gaussian_blur
from holobench_eval.metrics.feature_distance import FixedMofd, mofd
from holobench_eval.metrics.ms_ssim import FixedMsSsim, ms_ssim
from holobench_eval.optics.colour import srgb_decode, srgb_encode

Photograph = Callable[..., Tensor]


def _random(kind: str, shape: torch.Size) -> Tensor:
    generator = torch.Generator().manual_seed(9)
    if kind == "noise":
        return torch.randn(shape, generator=generator, dtype=torch.float64)
    return -torch.log1p(-torch.rand(shape, generator=generator, dtype=torch.float64))


SERIES: dict[str, list[Callable[[Tensor], Tensor]]] = {
    "blur": [lambda s, q=q: gaussian_blur(s[None], q)[0] for q in (0.5, 1.0, 2.0, 4.0)],
    "noise": [lambda s, q=q: (s + q * _random("noise", s.shape)).clamp(0, 1) for q in (0.01, 0.02, 0.05, 0.1, 0.2)],
    "speckle": [
        lambda s, q=q: srgb_encode(srgb_decode(s) * (1 + q * (_random("speckle", s.shape) - 1)))
        for q in (0.1, 0.25, 0.5, 1.0)
    ],
    "shift": [lambda s, q=q: torch.roll(s, q, dims=-1) for q in (1, 2, 3, 4, 6, 8)],
    "contrast": [lambda s, q=q: 0.5 + q * (s - 0.5) for q in (0.9, 0.75, 0.5, 0.25, 0.0)],
    "dimming": [lambda s, q=q: q * s for q in (0.9, 0.75, 0.5, 0.25, 0.0)],
}


@pytest.mark.parametrize("picture", ["astronaut", "camera", "grass"])
@pytest.mark.parametrize("kind", SERIES)
def test_a_stronger_distortion_is_further_away(photograph: Photograph, picture: str, kind: str) -> None:
    target = photograph(picture, 128)
    distances = [float(mofd(distort(target), target)) for distort in SERIES[kind]]
    assert distances == sorted(distances)
    assert 0 < distances[0] < 0.8 * distances[-1]
    assert 0.05 < distances[-1] <= 1


def test_colour_noise_of_constant_luma_is_seen(photograph: Photograph) -> None:
    target = 0.2 + 0.6 * photograph("coffee", 128)
    noise = 0.1 * _random("noise", target[:1].shape)
    image = (target + torch.cat([noise, -noise * 0.299 / 0.587, torch.zeros_like(noise)])).clamp(0, 1)
    assert float(mofd(image, target)) > 0.01


def test_unrelated_pictures_are_further_apart_than_any_half_speckled_one(photograph: Photograph) -> None:
    target, other = photograph("chelsea", 128), photograph("rocket", 128)
    speckled = SERIES["speckle"][2](target)
    assert float(mofd(other, target)) > 2 * float(mofd(speckled, target))


@pytest.mark.parametrize(("fixed", "plain"), [(FixedMofd, mofd), (FixedMsSsim, ms_ssim)])
def test_a_fixed_target_serves_many_images_with_the_plain_values(
    photograph: Photograph, fixed: type[FixedMofd] | type[FixedMsSsim], plain: Callable[[Tensor, Tensor], Tensor]
) -> None:
    target = photograph("coffee")
    measure = fixed(target)
    for distort in SERIES["noise"][:2]:
        assert torch.equal(measure(distort(target)), plain(distort(target), target))
    with pytest.raises(ValueError, match="differ in shape"):
        measure(target[:, 1:])
