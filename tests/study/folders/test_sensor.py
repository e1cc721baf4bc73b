"""What a camera does and light does not is seen in one capture, and what light does is not taken for it."""

import cv2
import numpy as np
import pytest
import torch

from holobench_eval.imaging.warp import Warp
from holobench_eval.metrics import score
from holobench_eval.optics.colour import srgb_decode
from holobench_eval.study.folders.doubts import MATTERS
from holobench_eval.study.folders.sensor import clipped, mended
from tests.support.photographed import photograph

SHAPE = (192, 256)
IN_PLACE = Warp(SHAPE, np.eye(3), np.zeros((6, 2)))


def draw(seed: int = 7) -> np.random.Generator:
    return np.random.default_rng(seed)


def light_of(target: np.ndarray) -> np.ndarray:
    return srgb_decode(torch.from_numpy(target)).numpy()


def flat_topped() -> np.ndarray:
    """A picture with an even white part, in levels of 255."""
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]] / 64
    picture = (0.5 + 0.4 * np.sin(3 * x) * np.cos(2 * y)) ** 2
    picture[110:150, 170:230] = 0.98
    return (np.round(picture * 255) / 255).astype(np.float32)


def written() -> np.ndarray:
    """Black words on white."""
    page = np.full(SHAPE, 255, np.uint8)
    for line in range(8):
        cv2.putText(page, "holography 123", (5, 22 + 22 * line), cv2.FONT_HERSHEY_SIMPLEX, 0.6, (0,), 1)
    return (page / 255).astype(np.float32)


PHOTOGRAPH = (np.round(photograph("astronaut", SHAPE).mean(axis=0) * 255) / 255).astype(np.float32)
TARGETS = {"photograph": PHOTOGRAPH, "flat": flat_topped(), "two levels": (PHOTOGRAPH > 0.5).astype(np.float32)}
TARGETS |= {"text": written(), "a box in the dark": np.pad(np.ones((10, 10), np.float32), ((90, 92), (120, 126)))}
LIGHT = {name: light_of(target) + 0.01 for name, target in TARGETS.items()}


def noisy(name: str, contrast: float = 0.2) -> np.ndarray:
    return LIGHT[name] * (1 + contrast * draw().standard_normal(SHAPE)).clip(0)


def counted(light: np.ndarray, most: int = 4095) -> np.ndarray:
    return np.round(light * most) / most


def dark_frame_off(light: np.ndarray, noise: float) -> np.ndarray:
    """12 bits that clip, less a dark frame with noise of its own."""
    return (
        np.minimum(np.round(64 + 4031 * light), 4095) - np.round(64 + noise * draw(8).standard_normal(SHAPE))
    ) / 4095


CLIPPED = {
    "the dark level taken off": ("flat", lambda name: np.minimum(counted(1.3 * noisy(name)), 4031 / 4095)),
    "a full well": ("photograph", lambda name: np.minimum(counted(1.3 * noisy(name)), 0.88)),
    "a full well and stuck pixels": (
        "photograph",
        lambda name: np.where(draw().random(SHAPE) < 3e-4, 1, np.minimum(counted(1.3 * noisy(name)), 0.88)),
    ),
    "a dark frame taken off": ("photograph", lambda name: dark_frame_off(1.3 * noisy(name), 4)),
    "8 bits after a gamma": (
        "flat",
        lambda name: np.minimum(counted((1.2 * noisy(name)).clip(0, 1) ** 0.45, 255), 250 / 255),
    ),
    "floating point": ("photograph", lambda name: np.minimum(1.2 * noisy(name), 0.8) / 7),
    "full speckle": ("photograph", lambda name: np.minimum(LIGHT[name] * draw().exponential(size=SHAPE) * 0.4, 0.9)),
    "even white alone": ("two levels", lambda name: np.minimum(counted(2 * noisy(name)), 0.9)),
    "no noise": ("photograph", lambda name: np.minimum(LIGHT[name], 0.5)),
}


@pytest.mark.parametrize("kind", CLIPPED)
def test_samples_that_pile_up_below_full_scale_are_clipped(kind):
    name, make = CLIPPED[kind]
    capture = make(name).astype(np.float32)
    share = clipped(capture[None], TARGETS[name][None], IN_PLACE, 1.0).mean()
    top = np.percentile(capture, 99.9) if "stuck" not in kind else 0.88
    assert share == pytest.approx((capture > 0.98 * top).mean(), rel=0.35)
    assert share > 0.001


HONEST = {
    "noise": lambda name: counted(0.45 * noisy(name)),
    "little noise": lambda name: counted(0.45 * noisy(name, 0.01)),
    "no noise": lambda name: counted(0.45 * LIGHT[name]),
    "no noise in 8 bits": lambda name: counted(0.8 * LIGHT[name], 255),
    "no noise in floating point": lambda name: LIGHT[name] / 3,
    "no noise and a blur": lambda name: cv2.GaussianBlur(counted(0.45 * LIGHT[name]), (0, 0), 0.8),
    "few levels": lambda name: counted(0.1 * noisy(name), 255),
    "full speckle": lambda name: counted((0.1 * LIGHT[name] * draw().exponential(size=SHAPE)).clip(0, 1)),
    "a camera's noise and a blur": lambda name: counted(
        cv2.GaussianBlur(0.7 * LIGHT[name] - 0.007, (0, 0), 0.8) + draw().normal(0, 3 / 4095, SHAPE)
    ).clip(0),
    "no noise in 8 bits and a blur": lambda name: cv2.GaussianBlur(
        counted(0.8 * LIGHT[name] - 0.008, 255), (0, 0), 0.8
    ),
    "a black level": lambda name: counted(0.4 * noisy(name) + 0.0625),
}


@pytest.mark.parametrize("name", TARGETS)
@pytest.mark.parametrize("kind", HONEST)
def test_what_is_bright_and_even_in_the_target_or_merely_bright_is_not_clipped(kind, name):
    capture = HONEST[kind](name).astype(np.float32)
    assert clipped(capture[None], TARGETS[name][None], IN_PLACE, np.inf).mean() < 0.001


def psnr(capture: np.ndarray) -> float:
    pair = (torch.from_numpy(each.astype(np.float32)[None]) for each in (capture, LIGHT["photograph"].clip(0, 1)))
    return score(*pair, metrics=("psnr",), refine=False, blur=())["psnr_linear"]


def interlaced(capture: np.ndarray) -> np.ndarray:
    capture[1::2] *= 0.7
    return capture


def mosaic(capture: np.ndarray) -> np.ndarray:
    seen = 0.1 * capture
    seen[1::2, ::2] = capture[1::2, ::2]
    return seen


def lines(capture: np.ndarray, value: float) -> np.ndarray:
    capture[:, 50] = capture[90] = value
    return capture


FAULTS = {
    "hot pixels": lambda capture: np.where(draw().random(SHAPE) < 5e-4, 3, capture),
    "warm pixels": lambda capture: capture + 0.5 * (draw().random(SHAPE) < 1e-3),
    "dead pixels": lambda capture: np.where(draw().random(SHAPE) < 5e-3, 0, capture),
    "a bright column and row": lambda capture: lines(capture, 2.0),
    "a dead column and row": lambda capture: lines(capture, 0.0),
    "two fields": interlaced,
    "a mosaic": mosaic,
}


@pytest.mark.parametrize("black", [0.0, 0.1])
@pytest.mark.parametrize("kind", FAULTS)
def test_what_stands_out_from_all_around_it_is_seen_and_its_cost_told(kind, black):
    good = noisy("photograph", 0.04).astype(np.float32)
    bad = FAULTS[kind](good.copy()).astype(np.float32)
    better, count = mended((bad + np.float32(black))[None], IN_PLACE)
    cost, left = psnr(good) - psnr(bad), psnr(good) - psnr(better[0] - black)
    assert cost > 3 * MATTERS
    assert left < 0.7 * cost
    assert count > 0


def test_noise_about_a_small_object_in_the_dark_is_no_fault_of_a_camera():
    capture = counted((0.3 * (LIGHT["a box in the dark"] - 0.01) + draw().normal(0, 0.001, SHAPE)).clip(0), 255)
    assert mended(capture.astype(np.float32)[None], IN_PLACE)[1] == 0


@pytest.mark.parametrize("contrast", [0.05, 0.3, 0.6, 1.0])
@pytest.mark.parametrize("grain", [0.0, 1.0])
def test_speckle_is_no_fault_of_a_camera(contrast, grain):
    grains = draw().exponential(size=SHAPE) if contrast == 1 else (1 + contrast * draw().standard_normal(SHAPE)).clip(0)
    grains = cv2.GaussianBlur(grains, (0, 0), grain) if grain else grains
    capture = (LIGHT["photograph"] * grains).astype(np.float32)
    assert psnr(mended(capture[None], IN_PLACE)[0][0]) < psnr(capture) + MATTERS
