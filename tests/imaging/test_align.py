"""A target is found in its capture by the two alone, and in no capture of anything else."""

import re
from pathlib import Path

import cv2
import numpy as np
import pytest

from holobench_eval.core.errors import CellError
from holobench_eval.imaging import align as aligning
from holobench_eval.imaging.align import Alignment, accepted, align, confirmed
from holobench_eval.imaging.shared_pose import sampled, shared
from holobench_eval.imaging.similarity import SIDE, Similarity, evened, reduced, similarity, structured, view
from holobench_eval.imaging.warp import Warp
from tests.support import photographed
from tests.support.photographed import Array, Picture, captured, corners, mapped, photograph, pose

SHAPE = (200, 250)
REAL = Path(__file__).resolve().parents[2] / "../shared/captures/stanford-2021"


def plane(homography: Array, shape: tuple[int, int] = SHAPE) -> Warp:
    return Warp(shape, np.asarray(homography, dtype=np.float64), np.zeros((6, 2)))


def made(name: str, seed: int, contrast: float, **where: float) -> tuple[Picture, Picture, Array]:
    draw = np.random.default_rng(seed)
    target = photograph(name, SHAPE)
    homography, size = pose(draw, SHAPE, **where)
    return captured(target, homography, size, draw, contrast=contrast), target, homography


@pytest.mark.parametrize(
    ("name", "contrast", "where"),
    [
        ("astronaut", 0.0, {"scale": 0.5, "perspective": 0.08}),
        ("coffee", 0.5, {"scale": 1.3, "turns": 1, "mirrored": True}),
        ("astronaut", 0.7, {"scale": 2.5, "turns": 2, "room": 1.6}),
        ("camera", 0.5, {"scale": 1.1, "turns": 3, "tilt": 8.0}),
        ("gravel", 0.3, {"scale": 0.9, "mirrored": True}),
        ("astronaut", 1.0, {"scale": 0.6, "turns": 2, "mirrored": True}),
    ],
)
def test_a_target_is_found_through_turns_mirrors_perspective_and_speckle(name, contrast, where):
    capture, target, homography = made(name, 5, contrast, **where)
    found = align(capture, target)
    off = np.linalg.norm(found.warp.corners() - mapped(homography, corners(SHAPE)), axis=1) / found.warp.scale()
    assert off.max() < (1.0 if contrast < 1 else 2.0)
    assert found.correlation > aligning.ALIKE


def test_templates_find_what_features_do_not(monkeypatch):
    monkeypatch.setattr(aligning, "by_features", lambda *_: iter(()))
    capture, target, homography = made("astronaut", 3, 1.0, scale=0.8, turns=1, mirrored=True)
    found = align(capture, target)
    assert np.abs(found.warp.corners() - mapped(homography, corners(SHAPE))).max() < 2 * found.warp.scale()


def half_replaced(target: Picture) -> Picture:
    return np.concatenate([target[..., :125], photograph("coffee", SHAPE)[..., 125:]], axis=2)


def shuffled(target: Picture) -> Picture:
    quarters = target.reshape(3, 2, 100, 2, 125).transpose(1, 3, 0, 2, 4).reshape(4, 3, 100, 125)[[2, 0, 3, 1]]
    return np.ascontiguousarray(quarters.reshape(2, 2, 3, 100, 125).transpose(2, 0, 3, 1, 4).reshape(3, *SHAPE))


def test_another_or_an_altered_target_is_refused_and_not_confirmed_in_a_known_pose_either():
    capture, target, homography = made("astronaut", 7, 0.3, scale=1.2)
    assert align(capture, target).correlation > aligning.ALIKE
    assert confirmed(capture, target, plane(homography)) is not None
    others = half_replaced(target), shuffled(target), photograph("chelsea", SHAPE), 1 - target
    for other in others:
        assert confirmed(capture, other, plane(homography)) is None
        with pytest.raises(CellError, match="not found in the capture"):
            align(capture, other)


STRIPES = np.broadcast_to(0.5 + 0.5 * np.sin(np.arange(250) / 4), (3, *SHAPE)).astype(np.float32)
DISC = np.broadcast_to(np.hypot(*np.mgrid[-100:100, -125:125]) < 20, (1, *SHAPE)).astype(np.float32)


@pytest.mark.parametrize(
    ("target", "why"),
    [
        (np.zeros((3, *SHAPE), np.float32), "structure in 0 of its 9 parts"),
        (DISC, "too little to find it by|not found"),
        (STRIPES, "one direction only"),
    ],
)
def test_a_target_without_enough_structure_is_refused(target, why):
    capture, _, _ = made("astronaut", 1, 0.3)
    with pytest.raises(CellError, match=why):
        align(capture, target)


@pytest.mark.parametrize(
    ("alike", "enough"),
    [
        (Similarity(0.6, (0.3,) * 6), True),
        (Similarity(0.59, (0.9,) * 9), False),
        (Similarity(0.9, (0.9,) * 4), True),
        (Similarity(0.9, (0.9,) * 3), False),
        (Similarity(0.9, (0.9,) * 4 + (0.2,)), False),
        (Similarity(0.9, (0.9,) * 5 + (0.2,)), True),
        (Similarity(0.9, (0.9,) * 7 + (0.2,), (True,)), False),
        (Similarity(0.9, (0.9,) * 8, (True,)), True),
        (Similarity(0.9, (0.9,) * 8, (True, True)), False),
    ],
)
def test_pictures_are_alike_overall_and_in_all_parts_but_one_in_six(alike, enough):
    assert accepted(alike) == enough


def test_the_symmetries_are_seven_and_keep_a_square_in_its_place():
    warps = list(aligning._symmetries((50, 50)))
    places = {tuple(map(tuple, np.round(warp.corners(), 6))) for warp in warps}
    assert len(warps) == len(places) == 7
    assert all({*place} == {(0, 0), (49, 0), (0, 49), (49, 49)} for place in places)
    assert tuple(map(tuple, corners((50, 50)))) not in places
    wide = np.array([warp.corners().mean(axis=0) for warp in aligning._symmetries((50, 80))])
    assert np.allclose(wide, [39.5, 24.5])


def test_a_camera_sees_no_fold_no_steep_perspective_and_no_extreme_scale_or_place():
    frame, inside = (400, 500), np.array([[1, 0, 100], [0, 1, 100], [0, 0, 1.0]])

    def sane(*rows, around=0.05):
        return not aligning._fault(plane(rows), frame, False, around)

    assert sane(*inside)
    assert sane([-1, 0, 400], [0, 1, 100], [0, 0, 1])  # mirrored
    for scale, fits in ((0.19, False), (0.21, True), (7.9, True), (8.1, False)):
        fault = aligning._fault(plane([[scale, 0, 0], [0, scale, 0], [0, 0, 1]]), (2000, 2500), False)
        assert ("0.2 to 8 are allowed" in fault) != fits
    room = 2.0 + 0.05 * 500  # two pixels and a twentieth of the frame
    for beyond, fits in ((room - 0.5, True), (room + 0.5, False)):
        for across, down in ((-beyond, 0), (0, -beyond), (499 - 249 + beyond, 0), (0, 399 - 199 + beyond)):
            assert sane([1, 0, across], [0, 1, down], [0, 0, 1]) == fits
    assert sane([1, 0, -(2.0 + 0.5 * 500) + 5], [0, 1, 0], [0, 0, 1], around=0.5)
    assert not sane([1, 0, 100], [0, 1, 100], [-1 / 240, 0, 1])  # folded
    assert not sane([np.nan, 0, 100], [0, 1, 100], [0, 0, 1])
    for steepness, fits in ((2.4, True), (2.6, False)):  # between the scales at two corners
        tilt = (steepness ** (2 / 3) - 1) / 249
        assert sane([1, 0, 50], [0, 1, 50], [tilt, 0, 1]) == fits


@pytest.mark.parametrize(("across", "down"), [(1, 0), (-1, 0), (0, 1), (0, -1)])
def test_two_pixels_of_a_target_may_lie_beyond_the_capture(across, down):
    frame = (2 * SHAPE[0], 2 * SHAPE[1])

    def fault(beyond):
        middle = np.array([0.5, 0.5])  # two capture pixels a target pixel, borders on borders
        x, y = middle + 2 * beyond * np.array([across, down])
        return aligning._fault(plane([[2, 0, x], [0, 2, y], [0, 0, 1]]), frame, False)

    assert fault(1.9) == ""
    side = {(1, 0): "right", (-1, 0): "left", (0, 1): "lower", (0, -1): "upper"}[across, down]
    assert f"reaches beyond the capture, 3 of its pixels on the {side} side" in fault(2.8)


def test_a_baseline_in_speckle_and_haze_is_confirmed_in_a_known_pose_and_nowhere_else():
    name = "astronaut"
    draw = np.random.default_rng(4)
    target = photograph(name, SHAPE)
    homography, size = pose(draw, SHAPE, scale=1.2)
    capture = photographed.drowned(target, homography, size, draw)
    with pytest.raises(CellError, match="not found"):
        align(capture, target)
    assert confirmed(capture, target, plane(homography)) is not None
    for moved in (8.0, -8.0):
        there = plane(np.array([[1, 0, moved], [0, 1, 0], [0, 0, 1.0]]) @ homography)
        assert confirmed(capture, target, there) is None
    for other in ("astronaut", "coffee", "camera", "rocket"):
        assert (other == name) == (confirmed(capture, photograph(other, SHAPE), plane(homography)) is not None)


@pytest.mark.parametrize(("name", "seed"), [("coffee", 0), ("camera", 3), ("rocket", 1)])
def test_a_part_that_speckle_makes_both_faint_and_displaced_counts_once(name, seed):
    draw, target = np.random.default_rng(seed), photograph(name, SHAPE)
    homography, size = pose(draw, SHAPE, scale=1.2)
    capture = photographed.drowned(target, homography, size, draw, haze=1.2 if name == "coffee" else 0.7)
    assert confirmed(capture, target, plane(homography)) is not None


@pytest.mark.parametrize(
    ("name", "other", "replaced"),
    [
        ("astronaut", "camera", np.s_[..., :125]),
        ("astronaut", "chelsea", np.s_[:, 100:]),
        ("rocket", "chelsea", np.s_[:, :100]),
    ],
)
def test_a_capture_of_which_half_shows_another_picture_is_not_confirmed_in_a_known_pose(name, other, replaced):
    draw, target = np.random.default_rng(7), photograph(name, SHAPE)
    homography, size = pose(draw, SHAPE, scale=1.2)
    half = target.copy()
    half[replaced] = photograph(other, SHAPE)[replaced]
    assert confirmed(captured(target, homography, size, draw, contrast=0.3), target, plane(homography)) is not None
    assert confirmed(captured(half, homography, size, draw, contrast=0.3), target, plane(homography)) is None


def test_alignments_that_agree_within_a_quarter_of_a_pixel_become_one():
    base = np.array([[1.2, 0, 40], [0, 1.2, 30], [0, 0, 1.0]])

    def shifted(by: float, correlation: float) -> Alignment:
        return Alignment(plane(np.array([[1, 0, by], [0, 1, 0], [0, 0, 1]]) @ base), correlation)

    found = {"a": shifted(-0.2, 0.9), "b": shifted(0.2, 0.9), "far": shifted(9.0, 0.99)}
    common = shared(found)
    assert common[1] == {"a", "b"}
    assert np.abs(common[0].corners() - plane(base).corners()).max() < 0.01
    still, moved = Alignment(plane(np.diag([3.0, 3.0, 1.0])), 0.99), np.diag([3.0, 3.0, 1.0])
    for apart, stands in ((0.2, {"still", "moved"}), (0.3, set())):
        moved[0, 2] = apart
        common = shared({"still": still, "moved": Alignment(plane(moved), 0.6)})
        assert common[1] == stands
    better, worse = (
        Alignment(plane(np.array([[1, 0, by], [0, 1, 0], [0, 0, 1.0]])), c) for by, c in ((0.0, 0.99), (0.9, 0.6))
    )
    common = shared({"better": better, "worse": worse})
    assert 0 < common[0].corners()[0, 0] < 0.1
    near, far = (Alignment(plane(np.array([[1, 0, by], [0, 1, 0], [0, 0, 1.0]])), c) for by, c in ((0, 0.9), (9, 0.8)))
    for found in ({"near": near, "far": far}, {"near": near}):
        common = shared(found)
        assert common == (near.warp, frozenset())
    assert shared({}) is None


def test_a_finer_capture_is_averaged_over_each_target_pixel():
    fine = np.random.default_rng(0).random((1, 80, 120)).astype(np.float32)
    twice = np.array([[2, 0, 0.5], [0, 2, 0.5], [0, 0, 1.0]])
    expected = fine.reshape(1, 40, 2, 60, 2).mean(axis=(2, 4))
    assert sampled(fine, plane(twice, (40, 60))) == pytest.approx(expected, abs=1e-4)
    assert sampled(fine, plane(np.eye(3), (80, 120))) == pytest.approx(fine, abs=1e-6)


def test_an_alignment_survives_its_plain_form():
    found = Alignment(plane(np.array([[1.234567890123, 0, 3], [0.1, 1, 2], [1e-5, 0, 1]])), 0.9)
    again = Alignment.from_dict(found.to_dict())
    assert (again.warp.homography == found.warp.homography).all()
    assert (again.warp.shape, again.correlation) == (SHAPE, 0.9)


@pytest.mark.skipif(not REAL.is_dir(), reason="the real captures are not here")
def test_a_real_capture_shows_no_other_picture():
    pixels = cv2.imread(str(REAL / "sgd-ours.png"))
    capture = np.ascontiguousarray(pixels[..., ::-1].transpose(2, 0, 1), dtype=np.float32) / 255
    for name in ("astronaut", "coffee"):
        with pytest.raises(CellError, match="not found"):
            align(capture, photographed.photograph(name, (400, 400)))


def cut(picture: Picture, homography: Array, side: str, pixels: float) -> Picture:
    """A capture without what lies beyond a line ``pixels`` of the target inside one of its sides."""
    ends, scale = mapped(homography, corners(SHAPE)), plane(homography).scale()
    left, top = np.ceil(ends.min(axis=0) + pixels * scale).astype(int)
    right, bottom = np.floor(ends.max(axis=0) - pixels * scale).astype(int)
    window = {"left": np.s_[:, :, left:], "upper": np.s_[:, top:], "right": np.s_[:, :, :right]}
    return np.ascontiguousarray(picture[window.get(side, np.s_[:, :bottom])])


@pytest.mark.parametrize(("side", "pixels"), [("left", 6), ("lower", 60)])
def test_a_target_that_is_cut_off_is_found_and_the_side_is_named(side, pixels):
    capture, target, homography = made("coffee", 2, 0.2, scale=1.2, tilt=0.0, perspective=0.0)
    with pytest.raises(CellError, match=r"is found .*correlation 0.* --visible") as error:
        align(cut(capture, homography, side, pixels), target)
    found = re.findall(r"(\d+) of its pixels on the (\w+) side", str(error.value))
    assert [name for _, name in found] == [side]
    assert int(found[0][0]) == pytest.approx(pixels, abs=3)


def test_a_target_of_another_scale_is_found_and_the_limits_are_named():
    target = photograph("coffee", (1200, 1500))
    small = cv2.resize(target.transpose(1, 2, 0), (180, 144), interpolation=cv2.INTER_AREA).transpose(2, 0, 1)
    capture = np.pad(small, ((0, 0), (30, 30), (30, 30)))
    with pytest.raises(CellError, match=r"found .* 0\.1\d+ capture pixels for each of its own; 0\.2 to 8 are allowed"):
        align(capture, target)


def test_pictures_that_are_alike_but_for_a_part_are_told_so():
    capture, target, _ = made("astronaut", 7, 0.1, scale=1.2)
    altered = target.copy()
    altered[:, :70, :120] = photograph("coffee", SHAPE)[:, :70, :120]
    altered[:, 130:, 130:] = photograph("coffee", SHAPE)[:, 130:, 130:]
    with pytest.raises(CellError, match=r"as a whole: the two are alike \(correlation 0\.[67]"):
        align(capture, altered)


@pytest.mark.parametrize(("side", "pixels", "contrast"), [("left", 80, 0.5), ("upper", 70, 0.5), ("lower", 6, 0.9)])
def test_the_visible_part_of_a_target_is_found_where_that_is_asked_for(side, pixels, contrast):
    capture, target, homography = made("astronaut", 2, contrast, scale=1.2, turns=0)
    part = cut(capture, homography, side, pixels)
    found = align(part, target, partly=True)
    full = mapped(homography, corners(SHAPE))
    shift = (
        (side == "left") * (capture.shape[2] - part.shape[2]),
        (side == "upper") * (capture.shape[1] - part.shape[1]),
    )
    # Where nothing was seen, a corner is extrapolated.
    assert np.linalg.norm(found.warp.corners() - (full - shift), axis=1).min() < 1.5 * found.warp.scale()
    assert np.linalg.norm(found.warp.corners() - (full - shift), axis=1).max() < 5 * found.warp.scale()


TARGET = photograph("astronaut", (120, 180)).mean(axis=0).astype(np.float32)


def warp(across=0.0, down=0.0, scale=1.0, shape=TARGET.shape):
    homography = np.array([[scale, 0, across], [0, scale, down], [0, 0, 1.0]])
    return Warp(shape, homography, np.zeros((6, 2)))


def test_a_reduced_picture_has_the_means_of_areas_and_a_small_one_is_not_reduced():
    fine = np.random.default_rng(0).random((60, 120)).astype(np.float32)
    small, back = reduced(fine, 40)
    assert small == pytest.approx(fine.reshape(20, 3, 40, 3).mean(axis=(1, 3)), abs=1e-6)
    assert back @ [0, 0, 1] == pytest.approx([1, 1, 1])  # the middle of the first 3 x 3 pixels
    assert back @ [39, 19, 1] == pytest.approx([118, 58, 1])
    wide, back = reduced(fine[:59], 50)
    assert wide.shape == (25, 50)
    assert back @ [-0.5, -0.5, 1] == pytest.approx([-0.5, -0.5, 1])  # borders lie on borders
    assert back @ [49.5, 24.5, 1] == pytest.approx([119.5, 58.5, 1])
    for side in (180, 200):
        small, back = reduced(TARGET, side)
        assert small is TARGET
        assert np.array_equal(back, np.eye(3))
    assert reduced(TARGET[:1], 90)[0].shape == (1, 90)


@pytest.mark.parametrize("scale", [1.0, 2.0])
def test_a_view_shows_target_and_capture_in_one_frame_and_says_where_the_capture_ends(scale):
    frame = np.kron(TARGET, np.ones((int(scale), int(scale)), np.float32))
    seen = view(frame, TARGET, warp(0.5 * (scale - 1), 0.5 * (scale - 1), scale))
    assert seen.reference.shape == seen.picture.shape == (64, SIDE)
    assert seen.inside[1:-1, 1:-1].all()
    assert np.abs(seen.reference - seen.picture)[2:-2, 2:-2].mean() < 0.03
    half = view(frame[:, : frame.shape[1] // 2], TARGET, warp(0.5 * (scale - 1), 0.5 * (scale - 1), scale))
    assert half.inside[2:-2, 2:46].all()
    assert not half.inside[:, 49:].any()


def test_an_evened_picture_keeps_structure_and_loses_illumination_and_what_lies_outside():
    everywhere = np.ones(TARGET.shape, bool)
    ramp = np.linspace(0.5, 1.5, TARGET.shape[1], dtype=np.float32)
    plain, lit = evened(TARGET, everywhere), evened(0.3 * TARGET * ramp, everywhere)
    assert np.corrcoef(plain.ravel(), lit.ravel())[0, 1] > 0.98
    assert np.abs(plain).max() < 4
    inside = np.ones(TARGET.shape, bool)
    inside[:, 90:] = False
    other = TARGET.copy()
    other[:, 90:] = 9.0
    assert np.array_equal(evened(TARGET, inside), evened(other, inside))
    assert not evened(TARGET, inside)[:, 90:].any()


def test_a_picture_is_wholly_like_itself_and_no_part_is_displaced():
    alike = similarity(TARGET, TARGET, warp())
    assert alike.overall == pytest.approx(1.0, abs=1e-3)
    assert len(alike.parts) == len(structured(TARGET)) == 9
    assert min(alike.parts) > 0.999
    assert not any(alike.displaced)
    assert similarity(1 - TARGET, TARGET, warp()).overall < -0.9


@pytest.mark.parametrize("step", [(8, 0), (0, 8), (-8, 0)])
def test_parts_that_lie_elsewhere_are_displaced_and_those_two_pixels_away_are_not(step):
    moved = np.roll(TARGET, step, axis=(0, 1))
    assert sum(similarity(moved, TARGET, warp()).displaced) >= 5  # 4 px of the reduced picture
    near = np.roll(TARGET, [np.sign(each) * 3 for each in step], axis=(0, 1))
    assert not any(similarity(near, TARGET, warp()).displaced)  # 1.6 px


def test_half_a_target_that_is_covered_can_be_compared_and_less_cannot():
    covered = similarity(TARGET[:, :100], TARGET, warp())
    assert covered.overall > 0.99
    assert len(covered.parts) < 9
    assert similarity(TARGET[:, :80], TARGET, warp()).overall == -1.0
    assert similarity(TARGET[:, :80], TARGET, warp()).parts == ()


def test_parts_are_ninths_and_hold_structure_above_a_level_of_eight_bits():
    flat = np.full((90, 60), 0.5, np.float32)
    draw = np.random.default_rng(0)
    flat[30:60, :20] += 0.006 * draw.choice([-1, 1], (30, 20)).astype(np.float32)
    flat[:30, 40:] += 0.002 * draw.choice([-1, 1], (30, 20)).astype(np.float32)
    assert structured(flat) == [(slice(30, 60), slice(0, 20))]
    assert structured(np.full((90, 60), 0.5, np.float32)) == []


def test_a_target_that_is_stretched_over_the_whole_capture_is_found_in_full_speckle():
    target = photograph("chelsea", (160, 200))
    stretched = np.diag([2.4, 1.2, 1.0])
    capture = captured(target, stretched, (192, 480), np.random.default_rng(3), contrast=1.0, grain=2.0)
    found = align(capture, target).warp.corners()
    assert np.abs(found - mapped(stretched, corners((160, 200)))).max() < 4
