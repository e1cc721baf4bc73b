"""The preflight checks on a simulated bench: what each mistake does to the picture, and what is reported of it."""

from functools import partial

import cv2
import numpy as np
import pytest
import torch

from holobench_eval.imaging.convention import Convention, Correction
from holobench_eval.lab.dark import given_dark
from holobench_eval.lab.exposure import averaged
from holobench_eval.lab.preflight import full_turn, linearity, phase_sign
from holobench_eval.lab.test_pattern import draw_pattern, find_pattern
from tests.support.simulated_devices import GREEN, Scene, SimulatedCamera, SimulatedSlm, Still, bench, pattern_phase


def photographer(**truth):
    """A picture of the green channel's light, straight from the scene; the phase is ``(1, H, W)``."""
    scene = Scene(bench(), **truth)
    panel = SimulatedSlm(scene)
    scene.channel = GREEN

    def show(phase, convention):
        panel.show(convention.levels(phase[0]))
        return torch.from_numpy(scene.light().copy())[None]

    return show


def green(initial_phase="random"):
    return pattern_phase(initial_phase=initial_phase)[GREEN : GREEN + 1]


def check_linearity(exposure=0.02, picture=None, **camera):
    still = Still(np.random.default_rng(0).exponential(size=(100, 100)) if picture is None else picture)
    device = SimulatedCamera(still, **{"noise": 2.0, "bits": 14, **camera})
    return linearity(partial(averaged, device, count=2, plane=0), exposure, given_dark(64.0)[0])


@pytest.mark.parametrize(
    ("settings", "line"),
    [
        ({"gamma": 0.9}, "is there gamma"),
        ({"gamma": 1.1}, "is there gamma"),
        ({"deaf": True}, "automatic gain"),
        ({"dark": 500.0}, "offset"),
        ({"exposure": 1.0}, "of the samples are saturated; shorten"),
        ({"exposures": (0.015, 1.0)}, "needs a factor of eight"),
        ({"gain": 0.0}, "is there"),
    ],
)
def test_a_camera_that_is_not_linear_is_refused_in_one_line(settings, line):
    assert check_linearity().line.startswith("linearity: r^2 1.0000")
    check = check_linearity(**settings)
    assert not check.passed
    assert line in check.line
    assert "\n" not in check.line


def test_a_reversed_sign_is_seen_and_named():
    check = phase_sign(photographer(sign=-1), green(), Convention())
    assert not check.passed
    assert "set phase.sign: -1" in check.line
    assert phase_sign(photographer(sign=-1), green(), Convention(sign=-1)).passed
    check = phase_sign(photographer(), green(), Convention(sign=-1))
    assert not check.passed
    assert "set phase.sign: 1 " in check.line


def test_a_mirrored_panel_and_a_mirrored_camera_look_the_same_and_are_only_told():
    for kind in ("mirrored", "flipped"):
        check = phase_sign(photographer(**{kind: True}), green(), Convention())
        assert check.passed
        assert "mirrored left-right" in check.line
        assert "set phase.flip_horizontal: true" in check.line
    flipped = phase_sign(photographer(flipped=True), green(), Convention(flip_horizontal=True))
    for check in (flipped, phase_sign(photographer(), green(), Convention())):
        assert check.passed
        assert check.line.startswith("phase convention: upright")


@pytest.mark.parametrize(
    ("turns", "mirrored", "words"),
    [
        (1, False, "turned by 90 degrees anticlockwise"),
        (2, False, "turned by 180 degrees"),
        (2, True, "mirrored upside down"),
        (1, True, "mirrored left-right and turned by 90"),
    ],
)
def test_turned_and_mirrored_cameras_pass_and_are_told(turns, mirrored, words):
    plain = photographer()

    def show(phase, convention):
        seen = plain(phase, convention)
        return torch.rot90(seen.flip(-1) if mirrored else seen, turns, (1, 2))

    check = phase_sign(show, green(), Convention())
    assert check.passed
    assert words in check.line


def test_a_picture_without_the_letter_is_refused_which_is_shown_with_random_phase():
    draw = np.random.default_rng(1)

    def show(phase, convention):
        return torch.from_numpy(draw.exponential(size=(1, 150, 180)))

    check = phase_sign(show, green(), Convention())
    assert not check.passed
    assert "no letter F with either sign" in check.line
    assert "phase.correction" not in check.line
    corrected = phase_sign(show, green(), Convention(correction=Correction("flat.bmp")))
    assert "phase.two_pi_level, phase.correction and the iris" in corrected.line
    wrong = photographer(sign=-1)
    rough, smooth = (
        find_pattern(wrong(green(start), Convention())[0].numpy()).correlation for start in ("random", "constant")
    )
    assert rough < 0.6 < smooth


@pytest.mark.parametrize("reversed_channel", [None, 0, 1])
def test_a_reversed_sign_in_any_channel_is_refused(reversed_channel):
    cameras = [photographer(sign=-1 if channel == reversed_channel else 1) for channel in range(2)]

    def show(phase, convention):
        return torch.cat([camera(part[None], convention) for camera, part in zip(cameras, phase, strict=True)])

    assert phase_sign(show, green().expand(2, -1, -1), Convention()).passed is (reversed_channel is None)


def test_a_level_that_costs_much_light_is_refused_with_the_best_and_another_is_only_remarked_on():
    check = full_turn(photographer(two_pi_level=175.0), green(), Convention())
    assert not check.passed
    named = float(check.line.split("light of ")[1].split(";")[0])
    assert abs(named - 175) < 0.08 * 175
    assert full_turn(photographer(two_pi_level=175.0), green(), Convention(two_pi_level=named)).passed
    for truth, level, words in ((200.0, 200.0, "200 gives"), (205.0, 256.0, "consider that")):  # costs little light
        check = full_turn(photographer(two_pi_level=truth), green(), Convention(two_pi_level=level))
        assert check.passed
        assert words in check.line


def test_every_laser_has_a_best_level_of_its_own():
    cameras = [photographer(two_pi_level=level) for level in (175.0, 256.0)]

    def show(phase, convention):
        parts = enumerate(zip(cameras, phase, strict=True))
        return torch.cat([camera(part[None], convention.of(i)) for i, (camera, part) in parts])

    both = green().expand(2, -1, -1)
    line = full_turn(show, both, Convention()).line
    first, second = (float(each) for each in line.split("light of [")[1].split("]")[0].split(","))
    assert abs(first - 175) < 0.08 * 175
    assert second > 1.3 * first
    assert full_turn(show, both, Convention(two_pi_level=(first, second))).line.endswith("of the best level")


@pytest.mark.parametrize(("size", "turn"), [(0.35, 0), (0.35, 95), (0.6, 7), (0.6, -140), (0.95, 7), (0.95, 95)])
def test_the_letter_is_found_at_any_size_place_and_angle_under_speckle(size, turn):
    picture = draw_pattern((200, 240)).numpy()
    pose = cv2.getRotationMatrix2D((119.5, 99.5), turn, size)
    pose[:, 2] += (150 - 119.5 + 9, 120 - 99.5 - 5)
    seen = cv2.warpAffine(picture, pose, (300, 240))
    speckle = np.random.default_rng(5).exponential(size=seen.shape)
    fit = find_pattern(((seen + 0.02) * speckle).astype(np.float32))
    assert fit.correlation > 0.8
    assert not fit.mirrored
    assert abs((fit.turn - turn + 180) % 360 - 180) < 4
    assert np.corrcoef(fit.where.ravel(), seen.ravel())[0, 1] > 0.8


def test_light_of_the_letter_is_that_of_its_strokes_above_the_ground():
    picture = 3 * draw_pattern((120, 120)).numpy() + 1
    fit = find_pattern(picture)
    assert fit.light(picture) == pytest.approx(3, rel=0.08)
