"""Speckle-like patterns: every phase value equally often, correlated as far as they say."""

from __future__ import annotations

import math

import pytest
import torch

from holobench_eval.methods.calibrated.patterns import LENGTHS, pattern_samples, random_phase
from tests.support.small_training import Memory, small_spec, training_bench

SHAPE = (160, 192)


@pytest.mark.parametrize("length", [2.0, 4.0])
def test_every_phase_value_is_equally_likely(length: float) -> None:
    phase = random_phase(3, SHAPE, length, torch.Generator().manual_seed(0))
    assert phase.shape == (3, *SHAPE)
    assert phase.abs().max() <= math.pi + 1e-6
    counts = torch.histc(phase, bins=8, min=-math.pi, max=math.pi) / phase.numel()
    assert (counts - 1 / 8).abs().max() < 0.03


@pytest.mark.parametrize("length", [2.0, 4.0, 8.0])
def test_neighbours_agree_within_the_correlation_length_and_not_beyond(length: float) -> None:
    field = torch.polar(torch.tensor(1.0), random_phase(3, SHAPE, length, torch.Generator().manual_seed(0)))

    def agreement(distance: int) -> float:
        return float((field[:, distance:] * field[:, :-distance].conj()).mean().abs())

    assert agreement(1) > 0.75
    assert 0.5 < agreement(int(length)) < 0.8
    assert agreement(int(5 * length)) < 0.25


def test_patterns_and_colours_differ_go_through_the_correlation_lengths_and_are_captured_once() -> None:
    spec, memory = small_spec(64, 48, colours=2), Memory()
    bench = training_bench(spec, memory)
    samples = pattern_samples(bench, 5)
    assert bench.captures == 5
    phases = [phase for sample in samples for phase in sample.phase]
    assert len({float(phase.double().sum()) for phase in phases}) == 10
    steps = [float((torch.polar(torch.ones(()), phase.diff(dim=-1)) - 1).abs().mean()) for phase in phases[::2]]
    assert steps[:4] == sorted(steps[:4], reverse=True)
    assert steps[4] == pytest.approx(steps[0], rel=0.1)
    assert len(LENGTHS) == 4
    assert {float(sample.target.unique()) for sample in samples} == {0.25}  # the camera is exposed for gray
    again = pattern_samples(training_bench(spec, memory), 5)
    assert memory.fate.passed == []
    for one, other in zip(samples, again, strict=True):
        assert torch.equal(one.capture, other.capture)
