from dataclasses import replace

import pytest
import torch

from holobench_eval.display import load_profile
from holobench_eval.display.simulated.geometry import Geometry

PANEL = (96, 128)


@pytest.fixture
def geometry():
    return Geometry(PANEL, 6.4e-6, 517e-9, 0.009, 3, 1, ("test", 0))


@pytest.fixture
def ideal():
    return load_profile("ideal").scaled(PANEL)


@pytest.fixture
def with_stage(ideal):
    """The ideal profile with some stages replaced."""
    return lambda **stages: replace(ideal, **stages)


@pytest.fixture
def phase():
    draw = torch.Generator().manual_seed(1)
    smooth = torch.nn.functional.interpolate(torch.randn(1, 3, 12, 16, generator=draw), size=PANEL, mode="bicubic")
    return 4 * smooth[0]
