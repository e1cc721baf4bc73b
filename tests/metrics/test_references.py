"""The floor shows what a picture without any skill scores."""

from __future__ import annotations

from collections.abc import Callable

import pytest
import torch
from torch import Tensor

from holobench_eval.metrics import floor_captures, score
from holobench_eval.optics.colour import srgb_decode

Photograph = Callable[..., Tensor]


@pytest.fixture
def targets(photograph: Photograph) -> list[Tensor]:
    return [srgb_decode(photograph(name, 64)).float() for name in ("astronaut", "coffee", "chelsea")]


def test_rows_have_their_names_and_the_targets_shape(targets: list[Tensor]) -> None:
    captures = floor_captures(targets[0], targets[1:], "astronaut")
    names = ("constant", "black", "speckle", "wrong_target", "mirrored", "shift_1px")
    assert set(captures) == {f"floor_{name}" for name in names}
    for capture in (made() for made in captures.values()):
        assert capture.shape == targets[0].shape
        assert capture.dtype == targets[0].dtype
        assert capture.data_ptr() not in {target.data_ptr() for target in targets}


def test_no_other_constant_scores_higher(targets: list[Tensor]) -> None:
    target = targets[0]
    level = floor_captures(target, targets[1:])["floor_constant"]()
    best = float((level - target).square().mean())
    assert all(float((level + d - target).square().mean()) > best for d in (-0.02, 0.02))
    assert score(level, target, metrics=("psnr",))["scale_0"] == pytest.approx(1.0, rel=1e-5)


def test_speckle_is_fully_developed_and_depends_on_its_names_alone(targets: list[Tensor]) -> None:
    first = floor_captures(targets[0], [], "astronaut")["floor_speckle"]()
    assert float(first.mean()) == pytest.approx(1.0, abs=0.03)
    assert float(first.std() / first.mean()) == pytest.approx(1.0, abs=0.03)
    assert torch.equal(first, floor_captures(targets[1], [], "astronaut")["floor_speckle"]())
    assert not torch.equal(first, floor_captures(targets[0], [], "coffee")["floor_speckle"]())


def test_the_wrong_target_is_the_next_and_absent_without_one(targets: list[Tensor]) -> None:
    assert torch.equal(floor_captures(targets[0], targets[1:])["floor_wrong_target"](), targets[1])
    assert "floor_wrong_target" not in floor_captures(targets[0], [])


def test_mirror_and_shift_move_a_point_as_named() -> None:
    point = torch.zeros(1, 16, 16)
    point[0, 4, 3] = 1
    captures = floor_captures(point, [])
    assert captures["floor_mirrored"]().nonzero().tolist() == [[0, 4, 12]]
    assert captures["floor_shift_1px"]().nonzero().tolist() == [[0, 4, 4]]


def test_targets_of_different_shapes_are_refused(targets: list[Tensor]) -> None:
    with pytest.raises(ValueError, match="one shape"):
        floor_captures(targets[0], [targets[1][:, 1:]])
