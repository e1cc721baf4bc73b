"""Three published captures of one real display keep their order and their scores."""

from pathlib import Path

import cv2
import numpy as np
import pytest
import torch
from numpy.typing import NDArray
from torch import Tensor

from holobench_eval.metrics import score

FOLDER = Path(__file__).resolve().parents[2] / "../shared/captures/stanford-2021"
PUBLISHED = {"sgd-asm": 20.94, "citl-asm": 25.16, "sgd-ours": 27.41}
Image = NDArray[np.float32]

pytestmark = pytest.mark.skipif(not FOLDER.is_dir(), reason="the real captures are not here")


def read(name: str) -> Image:
    image = cv2.imread(str(FOLDER / f"{name}.png"))
    return np.asarray(image[..., ::-1], dtype=np.float32) / np.float32(255)


def gray(image: Image) -> Image:
    return np.ascontiguousarray(image.mean(axis=2))


def aligned(capture: Image, target: Image) -> Image:
    """The capture through the homography of highest enhanced correlation."""
    height, width = target.shape[:2]
    stop = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 200, 1e-7)
    start = np.eye(3, dtype=np.float32)
    _, homography = cv2.findTransformECC(gray(target), gray(capture), start, cv2.MOTION_HOMOGRAPHY, stop, None, 5)
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    return np.asarray(cv2.warpPerspective(capture, homography, (width, height), flags=flags))


def tensor(image: Image) -> Tensor:
    return torch.from_numpy(np.ascontiguousarray(np.moveaxis(image, -1, 0)))


@pytest.fixture(scope="module")
def scores() -> dict[str, tuple[dict[str, float], dict[str, float]]]:
    """By capture: scores after the homography, and scores after crop and scale alone."""
    target = read("target")
    size = target.shape[1::-1]
    measured = {}
    for name in PUBLISHED:
        plain = cv2.resize(read(name)[0:960, 360:1320], size, interpolation=cv2.INTER_AREA)
        measured[name] = tuple(
            score(tensor(image), tensor(target), metrics=("psnr",), blur=())
            for image in (aligned(plain, target), plain)
        )
    return measured


def test_the_published_values_are_met(scores) -> None:
    found = {name: pair[0]["psnr_linear"] for name, pair in scores.items()}
    assert found == pytest.approx(PUBLISHED, abs=0.3)
    assert sorted(found, key=found.__getitem__) == list(PUBLISHED)


def test_the_rigid_refinement_alone_keeps_the_order(scores) -> None:
    plain = {name: pair[1]["psnr_linear"] for name, pair in scores.items()}
    refined = {name: pair[1]["psnr_linear_refined"] for name, pair in scores.items()}
    assert sorted(refined, key=refined.__getitem__) == list(PUBLISHED)
    for name, value in refined.items():
        assert plain[name] - 0.01 <= value <= scores[name][0]["psnr_linear"] + 0.05
