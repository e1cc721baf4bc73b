import numpy as np

from holobench_eval.optics.kernel.elementary import sincos


def test_sine_and_cosine_have_the_accuracy_that_they_state():
    angles = np.linspace(-60, 60, 200_001, dtype=np.float32)[::40]
    found = np.array([sincos(angle) for angle in angles])
    exact = np.stack([np.sin(angles.astype(float)), np.cos(angles.astype(float))], 1)
    assert np.abs(found - exact).max() < 1.5e-7
