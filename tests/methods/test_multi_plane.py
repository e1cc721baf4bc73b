import pytest
import torch

from holobench_eval.methods.multi_plane import MultiPlane
from holobench_eval.methods.wirtinger import Wirtinger

OFFSETS = [-4e-4, 0.0, 4e-4]


@pytest.fixture
def stack(scene):
    """Three pictures that differ, (3, 1, h, w)."""
    return torch.cat([scene(), scene().flip(-1), scene().flip(-2)])


def at(bench, make_bench, offset, **changes):
    """The bench with its image plane moved."""
    return make_bench(distance=bench.spec.distance + offset, **changes)


def test_one_plane_is_wirtinger_holography(bench, scene):
    target = scene(batch=2, channels=3)
    assert torch.equal(MultiPlane(iterations=15).solve(target, bench), Wirtinger(iterations=15).solve(target, bench))
    alone = MultiPlane(iterations=15).solve_planes(target[:1], [0.0], bench)
    assert torch.equal(alone, MultiPlane(iterations=15).solve(target[:1], bench)[0])


def test_every_plane_is_better_than_with_a_hologram_of_the_middle_one(make_bench, stack, linear_psnr):
    bench = make_bench(pupil=0.8)
    joint = MultiPlane(iterations=80).solve_planes(stack, OFFSETS, bench)[None]
    middle = Wirtinger(iterations=80).solve(stack[1:2], bench)
    for index in (0, 2):
        there = at(bench, make_bench, OFFSETS[index], pupil=0.8)
        target = stack[index : index + 1]
        assert linear_psnr(joint, target, there) > linear_psnr(middle, target, there) + 3


def test_a_positive_offset_is_farther_from_the_panel(make_bench, scene, linear_psnr):
    bench, target = make_bench(pupil=0.8), scene()
    phase = MultiPlane(iterations=60).solve_planes(target, [4e-4], bench)[None]
    far, near = (at(bench, make_bench, offset, pupil=0.8) for offset in (4e-4, -4e-4))
    assert linear_psnr(phase, target, far) > linear_psnr(phase, target, near) + 6
