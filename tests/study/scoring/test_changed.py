"""What is changed of a hologram when a model's control is measured."""

from __future__ import annotations

import pytest
import torch
from torch import Tensor

from holobench_eval.study.scoring.changed import PHASE_RMS, changed_target, moved_phase


def picture(bright: int, height: int = 60, width: int = 90) -> Tensor:
    """Gray, and brighter in the left half (0) or in the right one (1)."""
    target = torch.full((3, height, width), 0.2)
    target[..., bright * width // 2 : (bright + 1) * width // 2] = 0.4
    return target


@pytest.mark.parametrize("bright", [0, 1])
def test_the_brighter_half_loses_its_light_and_the_other_none(bright):
    target = picture(bright)
    changed = changed_target(target, "half", 3, "t")
    halves = changed.split(45, dim=-1)
    assert not halves[bright].any()
    assert torch.equal(halves[1 - bright], torch.full((3, 60, 45), 0.2))
    assert torch.equal(target, picture(bright))


@pytest.mark.parametrize(("level", "expected"), [(0.2, 1.0), (0.9, 0.0)])
def test_a_patch_of_a_fifth_of_the_side_becomes_white_or_black_if_it_was_bright(level, expected):
    target = torch.full((3, 60, 90), level)
    changed = changed_target(target, "patch", 3, "t") != target
    assert changed.sum() == 3 * 12**2
    assert (changed_target(target, "patch", 3, "t")[changed] == expected).all()
    assert not torch.equal(changed, changed_target(target, "patch", 3, "another") != target)


def test_the_phase_moves_smoothly_in_the_middle_of_the_panel_alone_and_by_names():
    phase = torch.rand((3, 128, 192), dtype=torch.float64)
    before = phase.clone()
    move = moved_phase(phase, 3, "t") - phase
    middle = move[:, 32:96, 48:144]
    assert float(middle.square().mean().sqrt()) == pytest.approx(PHASE_RMS)
    assert float(move.square().sum()) == pytest.approx(float(middle.square().sum()))
    assert float(middle.diff(dim=-1).abs().max()) < 0.4
    assert torch.equal(move[0].round(decimals=9), move[2].round(decimals=9))
    assert torch.equal(moved_phase(phase, 3, "t"), before + move) or torch.allclose(
        moved_phase(phase, 3, "t") - before, move
    )
    assert not torch.allclose(moved_phase(phase, 3, "another") - before, move)
