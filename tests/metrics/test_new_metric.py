"""A metric costs a file and a name: here the file lies beside the package's, and its name is added to the list."""

import sys
from pathlib import Path

import pytest
import torch

from holobench_eval import metrics
from holobench_eval.metrics import catalogue, score
from holobench_eval.report import scores

FILE = '''
"""Largest error of a pixel."""

from holobench_eval.metrics.base import Metric, paired


def worst_pixel(image, target):
    """Largest absolute error; images ``(C, H, W)`` or ``(B, C, H, W)`` in [0, 1]."""
    first, second = paired(image, target)
    return (first - second).abs().amax(dim=(1, 2, 3)).reshape(image.shape[:-3])


LOOK = {"title": "Worst pixel", "unit": "of white", "digits": 1}
METRIC = Metric("worst_pixel", "1", "lower", 0.0, ("linear",), worst_pixel, **LOOK)
'''


@pytest.fixture
def added(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "worst_pixel.py").write_text(FILE)
    monkeypatch.setattr(metrics, "__path__", [*metrics.__path__, str(tmp_path)])
    listed = sys.modules["holobench_eval.metrics.catalogue"]  # the package has a function of that name
    monkeypatch.setattr(listed, "NAMES", (*listed.NAMES, "worst_pixel"))


@pytest.mark.usefixtures("added")
def test_a_file_and_a_name_add_a_metric_to_scores_and_tables(monkeypatch: pytest.MonkeyPatch) -> None:
    target = torch.rand(3, 64, 64, generator=torch.Generator().manual_seed(1))
    found = score(target.clamp(0.1, 0.9), target, refine=False, blur=(), metrics=("worst_pixel",))
    assert 0 < found["worst_pixel_linear"] < 1
    monkeypatch.setattr(scores, "METRICS", {metric.name: metric for metric in catalogue()})
    column = scores.parse("worst_pixel_linear")
    assert (column.heading, column.number(0.25)) == ("Worst pixel, linear light [of white] (lower is better)", "0.2")
