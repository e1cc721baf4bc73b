"""What propagators share: the iris, the frequencies and the type of the field."""

import math

import pytest
import torch

from holobench_eval.optics import Fresnel
from holobench_eval.optics.convolution import frequencies, iris

PITCH = 6.4e-6


@pytest.mark.parametrize("pupil", [0.3, 0.8])
def test_an_iris_is_open_within_its_radius_and_closed_beyond_it_with_a_soft_edge(pupil):
    radius = torch.tensor([0.0, 0.5, 0.949, 0.975, 1.0, 1.025, 1.051, 2.0], dtype=torch.float64)
    for angle in (0.0, 1.0, math.pi / 2):
        f = radius * pupil / (2 * PITCH)
        passed = iris(f * math.sin(angle), f * math.cos(angle), PITCH, pupil)
        high, low = (2 + math.sqrt(2)) / 4, (2 - math.sqrt(2)) / 4
        assert passed.tolist() == pytest.approx([1, 1, 1, high, 0.5, low, 0, 0], abs=1e-6)


def test_without_an_iris_all_passes():
    fy, fx = frequencies((4, 6), PITCH)
    assert torch.equal(iris(fy, fx, PITCH, None), torch.ones(4, 6, dtype=torch.float64))


def test_frequencies_reach_half_a_cycle_a_pixel():
    fy, fx = frequencies((4, 5), PITCH)
    assert (fy.shape, fx.shape) == ((4, 1), (1, 5))
    assert (fy.ravel() * PITCH).tolist() == pytest.approx([0, 0.25, -0.5, -0.25])
    assert (fx.ravel() * PITCH).tolist() == pytest.approx([0, 0.2, 0.4, -0.4, -0.2])


def test_a_field_is_propagated_in_the_precision_of_the_model():
    field = torch.ones(8, 8)
    for dtype in (torch.complex64, torch.complex128):
        assert Fresnel((8, 8), PITCH, 517e-9, 1e-3, dtype=dtype).forward(field).dtype == dtype
