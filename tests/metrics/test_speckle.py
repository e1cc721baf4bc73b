"""Speckle contrast is std/mean where the target is flat, and says so when no patch is flat."""

from __future__ import annotations

import math

import pytest
import torch

from holobench_eval.metrics.speckle import speckle_contrast


def test_fully_developed_speckle_has_contrast_one_and_even_light_zero() -> None:
    target = torch.full((3, 128, 128), 0.4, dtype=torch.float64)
    uniform = torch.rand(target.shape, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    assert speckle_contrast(-torch.log1p(-uniform), target) == pytest.approx(1.0, abs=0.02)
    assert speckle_contrast(7 * target, target) == 0.0


def test_only_flat_and_lit_patches_count() -> None:
    target = torch.full((1, 16, 64), 0.5, dtype=torch.float64)
    target[..., 16:32] = torch.linspace(0, 1, 16)  # a ramp
    target[..., 32:48] = 0.01  # too dark
    capture = target.clone()
    capture[..., 16:48] = torch.rand(16, 32, generator=torch.Generator().manual_seed(1), dtype=torch.float64)
    capture[..., 48:56] = 0.25
    capture[..., 56:64] = 0.75
    assert speckle_contrast(capture, target) == pytest.approx((0.0 + 0.5) / 2)


def test_without_a_patch_there_is_no_number() -> None:
    ramp = torch.linspace(0, 1, 64, dtype=torch.float64).expand(1, 64, 64)
    assert math.isnan(speckle_contrast(ramp, ramp))
    flat = torch.full((1, 64, 64), 0.5)
    assert math.isnan(speckle_contrast(torch.zeros_like(flat), flat))


def test_wrong_input_is_refused() -> None:
    flat = torch.full((1, 32, 32), 0.5)
    with pytest.raises(ValueError, match="expected"):
        speckle_contrast(flat, flat[:, :16])
    with pytest.raises(ValueError, match="at least 16"):
        speckle_contrast(flat[:, :8], flat[:, :8])
    with pytest.raises(ValueError, match="finite"):
        speckle_contrast(flat * math.nan, flat)
