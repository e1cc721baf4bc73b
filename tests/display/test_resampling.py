import pytest
import torch

from holobench_eval.display.resampling import Resampling
from holobench_eval.imaging.warp import remap


@pytest.fixture
def frame():
    return torch.rand(40, 50, generator=torch.Generator().manual_seed(1))


@pytest.fixture
def resampling():
    """Places of which some lie outside of the frame."""
    draw = torch.Generator().manual_seed(2)
    return Resampling(56 * torch.rand(30, 35, generator=draw) - 3, 46 * torch.rand(30, 35, generator=draw) - 3)


def test_a_frame_is_resampled_as_a_capture_is_rectified(frame, resampling):
    rectified = remap(frame.numpy(), resampling.x.numpy(), resampling.y.numpy())
    assert torch.allclose(resampling(frame), torch.from_numpy(rectified), atol=2e-5)


def test_pixels_picked_by_index_give_the_same_and_the_same_gradient(frame, resampling):
    for resample in (resampling, resampling._gathered):
        given = frame.clone().requires_grad_()
        seen = resample(given)
        seen.square().sum().backward()
        assert torch.allclose(seen, resampling(frame), atol=2e-5)
        reference = frame.clone().requires_grad_()
        resampling(reference).square().sum().backward()
        assert torch.allclose(given.grad, reference.grad, atol=1e-4)


def test_the_noise_gain_is_the_variance_of_resampled_noise(resampling):
    draw = torch.Generator().manual_seed(3)
    inside = (resampling.x > 2) & (resampling.x < 46) & (resampling.y > 2) & (resampling.y < 36)
    seen = torch.stack([resampling(torch.randn(40, 50, generator=draw)) for _ in range(2000)])
    assert torch.allclose(seen.var(0)[inside], resampling.noise_gain[inside], rtol=0.2)
    assert abs(float((seen.var(0) / resampling.noise_gain)[inside].mean()) - 1) < 0.01
