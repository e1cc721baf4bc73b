"""Phase to the levels of a real panel and back."""

import math

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from holobench_eval.imaging.convention import Convention

PHASE = torch.linspace(-7, 7, 64 * 48).reshape(64, 48)

conventions = st.builds(
    Convention,
    sign=st.sampled_from([1, -1]),
    origin=st.floats(-4, 4),
    two_pi_level=st.floats(40, 256),
    flip_horizontal=st.booleans(),
    flip_vertical=st.booleans(),
)


@given(conventions)
def test_levels_stand_for_the_phase_to_half_a_level(convention):
    back = convention.phase(convention.levels(PHASE))
    error = torch.remainder(back - PHASE + math.pi, math.tau) - math.pi
    assert float(error.abs().max()) <= math.tau / convention.two_pi_level / 2 * 1.01 + 1e-5 or (
        float(error.abs().max()) <= math.tau / convention.two_pi_level  # where two pi is between two levels
    )


def test_the_default_has_256_levels_to_two_pi():
    levels = Convention().levels(torch.tensor([[0.0, math.pi, math.tau, -math.pi / 2]]))
    assert levels.tolist() == [[0, 128, 0, 192]]
    assert levels.dtype == np.uint8


def test_a_reversed_sign_gives_the_conjugate_hologram():
    assert np.array_equal(Convention(sign=-1).levels(PHASE), Convention().levels(-PHASE))


@pytest.mark.parametrize(("flips", "axis"), [({"flip_horizontal": True}, 1), ({"flip_vertical": True}, 0)])
def test_flips_mirror_what_the_panel_gets(flips, axis):
    assert np.array_equal(Convention(**flips).levels(PHASE), np.flip(Convention().levels(PHASE), axis))


def test_a_panel_that_reaches_no_full_turn_goes_to_the_nearer_end():
    short = Convention(two_pi_level=400)
    levels = short.levels(torch.tensor([[0.0, math.tau * 250 / 400, math.tau * 300 / 400, math.tau * 390 / 400]]))
    assert levels.tolist() == [[0, 250, 255, 0]]
