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


whole = st.integers(40, 256).map(float)  # of others, a level may lie as near to a full turn as to level 0
full_turns = st.one_of(whole, st.tuples(whole, whole, whole))
maps = st.integers(0, 2**32 - 1).map(lambda seed: np.random.default_rng(seed).random((3, 8, 6)))


@given(
    st.builds(
        Convention,
        sign=st.sampled_from([1, -1]),
        origin=st.floats(-4, 4),
        two_pi_level=full_turns,
        flip_horizontal=st.booleans(),
        flip_vertical=st.booleans(),
        turns=st.one_of(st.just(0.0), maps, maps.map(lambda each: each[0])),
    )
)
def test_levels_of_three_lasers_come_back_whatever_the_convention_and_one_by_one_as_together(convention):
    full = np.broadcast_to(np.array(convention.two_pi_level), 3)[:, None, None]
    levels = np.random.default_rng(0).integers(0, np.floor(full).astype(int), (3, 8, 6)).astype(np.uint8)
    phase = convention.phase(levels)
    assert np.array_equal(convention.levels(phase), levels)
    for channel in range(3):
        alone = convention.of(channel)
        assert np.array_equal(alone.levels(phase[channel]), levels[channel])
        assert torch.equal(alone.phase(levels[channel]), phase[channel])


def test_a_correction_is_added_modulo_a_turn_to_what_the_panel_gets():
    turns = np.array([[0.25, 0.75]])
    convention = Convention(two_pi_level=(200.0, 100.0), flip_horizontal=True, turns=turns)
    phase = math.tau * torch.tensor([[[0.0, 0.5]], [[0.0, 0.5]]])
    assert convention.levels(phase).tolist() == [[[150, 150]], [[75, 75]]]


@pytest.mark.parametrize(("level", "says"), [(256.0, ""), (311.0, "18% of"), ((311.0, 256.0, 221.0), "18%, 0%, 0% of")])
def test_a_full_turn_out_of_reach_has_a_line(level, says):
    assert says in Convention(two_pi_level=level).out_of_reach
    assert bool(Convention(two_pi_level=level).out_of_reach) == bool(says)


def test_the_default_has_256_levels_to_two_pi():
    levels = Convention().levels(torch.tensor([[0.0, math.pi, math.tau, -math.pi / 2]]))
    assert levels.tolist() == [[0, 128, 0, 192]]
    assert levels.dtype == np.uint8


def test_a_panel_that_reaches_no_full_turn_goes_to_the_nearer_end():
    short = Convention(two_pi_level=400)
    levels = short.levels(torch.tensor([[0.0, math.tau * 250 / 400, math.tau * 300 / 400, math.tau * 390 / 400]]))
    assert levels.tolist() == [[0, 250, 255, 0]]
