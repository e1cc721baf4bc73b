"""From an image to a target: aspect, light, range."""

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from holobench_eval.core.errors import UserError
from holobench_eval.datasets.base import fit, from_srgb, with_channels
from holobench_eval.optics import srgb_decode

SIDES = st.integers(1, 40)


def disc(shape: tuple[int, int], radius: float) -> torch.Tensor:
    y = torch.arange(shape[0])[:, None] - (shape[0] - 1) / 2
    x = torch.arange(shape[1])[None, :] - (shape[1] - 1) / 2
    return (torch.hypot(y, x) < radius).float()[None]


def spread(image: torch.Tensor) -> tuple[float, float]:
    """Standard deviation of the light in rows and in columns [px]."""
    weight = image[0].double()
    found = []
    for axis in (0, 1):
        profile = weight.sum(1 - axis)
        place = torch.arange(len(profile), dtype=torch.float64)
        mean = (profile * place).sum() / profile.sum()
        found.append(float(((profile * (place - mean) ** 2).sum() / profile.sum()).sqrt()))
    return found[0], found[1]


@pytest.mark.parametrize("source", [(200, 400), (401, 203), (90, 120)])
@pytest.mark.parametrize("shape", [(80, 150), (61, 97)])
def test_a_circle_stays_a_circle_of_the_size_the_crop_implies(source, shape):
    radius = 0.2 * min(source)
    rows, columns = spread(fit(disc(source, radius), shape))
    scale = min(source[0] / shape[0], source[1] / shape[1])
    assert rows == pytest.approx(columns, rel=0.02)
    assert rows == pytest.approx(radius / scale / 2, rel=0.05)


def test_the_crop_is_centred_and_as_large_as_the_aspect_allows():
    columns = torch.linspace(0, 1, 200).expand(1, 100, 200)
    cropped = fit(columns, (100, 100))
    assert torch.allclose(cropped, columns[..., 50:150], atol=1e-6)
    assert torch.equal(fit(cropped, (100, 100)), cropped)  # it has the right size already


def test_fine_stripes_average_in_linear_light():
    """Black and white lines of one pixel reflect half the light; averaged in sRGB they would give 0.21."""
    stripes = np.zeros((128, 128, 3), np.uint8)
    stripes[:, ::2] = 255
    small = fit(from_srgb(stripes), (16, 16))
    assert torch.allclose(small, torch.full_like(small, 0.5), atol=0.03)


def test_a_small_image_is_enlarged_without_new_extremes():
    image = torch.rand(3, 8, 8, generator=torch.Generator().manual_seed(2))
    large = fit(image, (50, 50))
    assert large.shape == (3, 50, 50)
    assert float(large.max()) <= float(image.max()) + 1e-6
    assert float(large.min()) >= float(image.min()) - 1e-6


@given(source=st.tuples(SIDES, SIDES), shape=st.tuples(SIDES, SIDES))
def test_any_source_fits_any_shape_and_flat_light_stays_flat(source, shape):
    flat = fit(torch.full((3, *source), 0.3), shape)
    assert flat.shape == (3, *shape)
    assert torch.allclose(flat, torch.full_like(flat, 0.3), atol=1e-6)


def test_levels_are_decoded_as_srgb():
    levels = np.arange(256, dtype=np.uint8)[None]
    expected = srgb_decode(torch.arange(256) / 255)
    assert torch.allclose(from_srgb(levels), expected.expand(3, 1, 256), atol=1e-6)
    deep = np.array([[0, 65535, 32768]], dtype=np.uint16)
    assert torch.allclose(from_srgb(deep)[0], srgb_decode(torch.tensor([[0, 1, 32768 / 65535]])), atol=1e-6)


def test_luminance_of_white_is_one_and_other_counts_are_refused():
    assert float(with_channels(torch.ones(3, 2, 2), 1).max()) == pytest.approx(1.0)
    with pytest.raises(UserError, match="not 4"):
        with_channels(torch.ones(3, 2, 2), 4)


@pytest.mark.parametrize("colour", range(3))
def test_a_picture_with_light_in_one_colour_is_on_one_laser_what_it_is_in_gray(colour):
    light = torch.rand(8, 9, generator=torch.Generator().manual_seed(3))
    picture = torch.zeros(3, 8, 9)
    picture[colour] = light
    assert torch.equal(with_channels(picture, 1), light[None])
    assert torch.allclose(with_channels(light.expand(3, -1, -1), 1), light[None])
