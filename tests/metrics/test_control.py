"""Control: 1 for who answers as the display does, 0 for who does not answer."""

from __future__ import annotations

import pytest
import torch
from torch import Tensor

from holobench_eval.metrics.control import CHANGES, COLUMNS, MOST, control

UNIT = torch.tensor([0.1, 2.0, 30.0]).view(3, 1, 1)


def picture(name: int) -> Tensor:
    return torch.rand((3, 32, 32), generator=torch.Generator().manual_seed(name), dtype=torch.float64)


def answered(model: float) -> dict[str, float]:
    """Of a model that predicts the unchanged picture and this share of each change."""
    before = picture(0)
    after = {change: picture(k) for k, change in enumerate(CHANGES, start=1)}
    changed = {name: (one, UNIT * (before + model * (one - before))) for name, one in after.items()}
    return control(before, before, UNIT * before, changed)


@pytest.mark.parametrize(("model", "expected"), [(1, 1), (0, 0), (0.5, 0.75), (-1, -3), (2, 0)])
def test_control_is_one_less_the_squared_error_of_the_answer_whatever_the_unit(model: float, expected: float) -> None:
    found = answered(model)
    assert {*found} == {*COLUMNS}
    assert found.pop(MOST) == 1
    assert list(found.values()) == pytest.approx([expected] * len(found), abs=1e-9)


def test_a_change_of_brightness_is_part_of_the_answer() -> None:
    before = picture(0)
    assert control(before, before, before, {"half": (2 * before, 2 * before)})["control_half"] == pytest.approx(1)
    assert control(before, before, before, {"half": (2 * before, before)})["control_half"] == pytest.approx(0)


def test_a_perfect_model_lacks_what_the_noise_of_both_captures_takes_and_a_second_capture_tells() -> None:
    before, after = 4 * picture(0), 4 * picture(1)
    noise = [0.5 * torch.randn(before.shape, generator=torch.Generator().manual_seed(9 + k)) for k in range(3)]
    found = control(before + noise[0], before + noise[1], before, {"patch": (after + noise[2], after)})
    assert found["control"] == pytest.approx(found[MOST], abs=0.01)
    assert found[MOST] < 0.9
