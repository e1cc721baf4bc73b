"""Every metric gives the value that its reference implementation gives on two photographs."""

import numpy as np
import pytest
import skimage.data
import torch
from torch import Tensor

from holobench_eval.metrics import catalogue

# Measured once in float64 with piq, torchmetrics (ms_ssim), scikit-image (ssim) and flip-evaluator: camera, astronaut.
GOLDEN = {
    "psnr": (29.1064044, 29.4334246),
    "ssim": (0.7815291, 0.7872824),
    "ms_ssim": (0.7861212, 0.8946206),
    "gmsd": (0.2149708, 0.1655272),
    "haarpsi": (0.4476441, 0.7036092),
    "mdsi": (0.4892155, 0.4312724),
    "fsim": (0.8272706, 0.8739498),
    "vsi": (0.9328012, 0.9578117),
    "flip": (0.1623393, 0.1562996),
}


def golden_pair(name: str) -> tuple[Tensor, Tensor]:
    """A photograph and the same with a diagonal wave of 5 % added."""
    image = np.atleast_3d(getattr(skimage.data, name)() / 255)
    rows, columns = np.mgrid[: image.shape[0], : image.shape[1]]
    wave = 0.05 * np.sin(2 * np.pi * (columns / 16 + rows / 24))
    pair = (image, np.clip(image + wave[..., None], 0, 1))
    first, second = (torch.from_numpy(np.moveaxis(side, -1, 0).copy()) for side in pair)
    return first, second


@pytest.mark.parametrize("picture", ["camera", "astronaut"])
def test_metrics_equal_their_golden_values(picture: str) -> None:
    image, target = golden_pair(picture)
    column = ["camera", "astronaut"].index(picture)
    metrics = {metric.name: metric for metric in catalogue()}
    measured = {name: float(metrics[name].function(image, target)) for name in GOLDEN}
    assert measured == pytest.approx({name: values[column] for name, values in GOLDEN.items()}, abs=1.5e-7)
