"""The nearest level is that of the table, and the display shows it."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from holobench_eval.display import load_profile
from holobench_eval.display.api import DisplaySpec
from holobench_eval.methods.coarse.levels import Levels
from holobench_eval.optics.phase import TAU, blaze, gray_level
from tests.support.small_training import small_spec

PHASE = st.floats(-20, 20)
TABLES = st.lists(st.floats(0, TAU, exclude_max=True), min_size=2, max_size=2, unique=True) | st.lists(
    st.floats(0, TAU, exclude_max=True), min_size=16, max_size=16, unique=True
)


def spec_of(table: list[float]) -> DisplaySpec:
    spec = small_spec(8, 8)
    return replace(spec, shape=(1, 1), bits=int(math.log2(len(table))), levels=(tuple(table),))


@given(TABLES, PHASE)
def test_no_other_level_is_nearer_around_the_circle(table: list[float], phase: float) -> None:
    level = int(
        Levels(spec_of(table), 0, torch.zeros((), dtype=torch.float64)).nearest(torch.full((1, 1), phase).double())
    )
    apart = [abs(math.remainder(phase - value, TAU)) for value in table]
    assert apart[level] == pytest.approx(min(apart), abs=1e-6)  # a spec keeps its table in float32


@pytest.mark.parametrize("cycles", [(0.0, 0.0), (0.25, -0.11)])
@pytest.mark.parametrize("bits", [1, 4, 8])
def test_the_display_shows_the_level_that_is_meant(bits: int, cycles: tuple[float, float]) -> None:
    spec = replace(small_spec(16, 8), bits=bits, blaze=cycles)
    wanted = torch.randint(2**bits, spec.shape, generator=torch.Generator().manual_seed(1))
    given = Levels(spec, 0, torch.zeros(())).shown_by(wanted)
    assert torch.equal(gray_level(given + blaze(spec.shape, cycles), bits), wanted.float())


def test_equal_steps_are_what_the_display_would_choose_itself() -> None:
    spec = small_spec(16, 8)
    phase = 40 * torch.rand(spec.shape, generator=torch.Generator().manual_seed(1)) - 20
    assert torch.equal(Levels(spec, 0, phase).nearest(phase).float(), gray_level(phase, spec.bits))


def test_light_from_a_level_has_the_phase_that_the_bench_gives_it() -> None:
    profile = load_profile("plm-4bit")
    spec = profile.spec((64, 64))
    level = torch.arange(16.0).view(4, 4)
    levels = Levels(spec, 1, level)
    assert torch.allclose(levels.light(level.long()), profile.lut.phase(level, 4, torch.ones(()), 1), atol=1e-5)
