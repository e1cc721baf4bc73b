"""Large images are compared in strips, which take less memory and change no score."""

from __future__ import annotations

import pytest
import torch

from holobench_eval.metrics import feature_distance, flip, haarpsi

PAIR = [
    torch.rand(3, 150, 130, dtype=torch.float64, generator=torch.Generator().manual_seed(seed)).mul(0.3).add(0.1 * seed)
    for seed in (1, 2)
]


@pytest.mark.parametrize("channels", [1, 3])
@pytest.mark.parametrize(("module", "name"), [(feature_distance, "mofd"), (flip, "flip"), (haarpsi, "haarpsi")])
def test_the_score_of_strips_is_that_of_the_image(monkeypatch, module, name, channels):
    pair = [side[:channels] for side in PAIR]
    entire = getattr(module, name)(*pair)
    monkeypatch.setattr(module, "LARGEST_AT_ONCE", 1000, raising=False)
    monkeypatch.setattr(module, "STRIP", 130 * 40)
    # The package flip-evaluator adds 20,000 errors in single precision.
    assert float(getattr(module, name)(*pair)) == pytest.approx(float(entire), rel=1e-5 if name == "flip" else 1e-12)
