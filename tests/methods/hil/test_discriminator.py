"""A discriminator's patches have the published size, and only a conditional one sees the ideal image."""

from __future__ import annotations

import pytest
import torch
from torch import Tensor, nn

from holobench_eval.core.errors import UserError
from holobench_eval.methods.hil.discriminator import MultiScaleDiscriminator, PatchDiscriminator


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


def test_pix2pix_has_as_many_parameters_as_published() -> None:
    """2.769 million, as the authors' program prints."""
    with torch.device("meta"):
        discriminator = PatchDiscriminator(3, 3, flat=2)
    assert sum(value.numel() for value in discriminator.parameters()) == pytest.approx(2.769e6, abs=500)


@pytest.mark.parametrize("kind", [PatchDiscriminator, MultiScaleDiscriminator])
def test_only_a_conditional_discriminator_sees_the_ideal_image(
    kind: type[PatchDiscriminator | MultiScaleDiscriminator],
) -> None:
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
def test_the_smallest_image_leaves_one_patch_and_a_smaller_one_is_refused(
    discriminator: PatchDiscriminator | MultiScaleDiscriminator, smallest: int
) -> None:
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
