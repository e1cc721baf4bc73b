"""A constant in the counts of a capture is seen, whatever their scale."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from holobench_eval.lab.dark import Dark
from holobench_eval.optics.colour import srgb_decode
from holobench_eval.study.folders.doubts import LIFTED
from holobench_eval.study.folders.exposure import darkest
from tests.support.photographed import photograph

TARGET = srgb_decode(torch.from_numpy(photograph("astronaut", (80, 100)))).double()
MEAN = float(TARGET.mean())


@settings(max_examples=40, deadline=None)
@given(black=st.floats(0.1, 2.0), gain=st.floats(1e-3, 1e6))
def test_a_constant_is_seen_at_any_gain_and_not_once_it_is_taken_off(black, gain):
    """black: of the mean of the light."""
    counts = gain * (TARGET + black * MEAN)
    lifted = darkest(counts, TARGET)
    assert lifted == pytest.approx(darkest(TARGET + black * MEAN, TARGET), rel=1e-6)
    assert lifted > 0.8 * black * MEAN / (1 + black)
    light = Dark(np.array(gain * black * MEAN)).off(counts.numpy())
    assert abs(darkest(torch.from_numpy(light), TARGET)) < 1e-3 < LIFTED
    assert darkest(TARGET - black * MEAN / 2, TARGET) < 0  # too much was taken off
