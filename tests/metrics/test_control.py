"""Control: 1 for who answers as the display does, 0 for who does not answer."""

from __future__ import annotations

import pytest
import torch
from torch import Tensor

from holobench_eval.metrics.control import CHANGES, COLUMNS, control

UNIT = torch.tensor([0.1, 2.0, 30.0]).view(3, 1, 1)


def picture(name: int) -> Tensor:
    return torch.rand((3, 32, 32), generator=torch.Generator().manual_seed(name), dtype=torch.float64)


def answered(model: float) -> dict[str, float]:
    """Of a model that predicts the unchanged picture and this share of each change."""
    before = picture(0)
    after = {change: picture(k) for k, change in enumerate(CHANGES, start=1)}
    changed = {name: (one, UNIT * (before + model * (one - before))) for name, one in after.items()}
    return control(before, UNIT * before, changed)


@pytest.mark.parametrize(("model", "expected"), [(1, 1), (0, 0), (0.5, 0.75), (-1, -3), (2, 0)])
def test_control_is_one_less_the_squared_error_of_the_answer_whatever_the_unit(model: float, expected: float) -> None:
    found = answered(model)
    assert {*found} == {*COLUMNS}
    assert list(found.values()) == pytest.approx([expected] * len(COLUMNS), abs=1e-9)


def test_a_change_of_brightness_is_part_of_the_answer() -> None:
    before = picture(0)
    assert control(before, before, {"half": (2 * before, 2 * before)})["control_half"] == pytest.approx(1)
    assert control(before, before, {"half": (2 * before, before)})["control_half"] == pytest.approx(0)


def test_the_noise_of_both_captures_is_what_a_perfect_model_lacks() -> None:
    before, after = 4 * picture(0), 4 * picture(1)
    noisy = [
        clean + 0.3 * torch.randn(clean.shape, generator=torch.Generator().manual_seed(9 + k)).double()
        for k, clean in enumerate((before, after))
    ]
    found = control(noisy[0], before, {"patch": (noisy[1], after)})["control"]
    assert found == pytest.approx(1 - 2 * 0.3**2 / (after - before).square().mean().item(), abs=0.01)
