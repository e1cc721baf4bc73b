"""Pictures as integer levels: what is stored comes back, whatever library would have made of it."""

import numpy as np
import pytest
import torch

from holobench_eval.core.io import write_png
from holobench_eval.core.pictures import open_picture


@pytest.mark.parametrize("channels", [1, 3])
@pytest.mark.parametrize("bits", [8, 16])
def test_levels_of_a_png_come_back_as_they_were_written(tmp_path, channels, bits):
    kind = np.uint8 if bits == 8 else np.uint16
    levels = np.random.default_rng(0).integers(0, 2**bits, (channels, 6, 5), dtype=np.int64)
    write_png(tmp_path / "a.png", torch.from_numpy(levels), bits)
    decoded = open_picture((tmp_path / "a.png").read_bytes()).values()
    assert decoded.dtype == kind
    assert np.array_equal(decoded, levels[0] if channels == 1 else levels.transpose(1, 2, 0))
