"""The compiled kernel against torch's transforms, and what happens without it."""

import copy
import pickle
import subprocess
import sys

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from holobench_eval.optics import AngularSpectrum, blocks, transfer
from holobench_eval.optics.kernel.sizes import RADICES, fast_size, steps
from holobench_eval.optics.transfer import Fused, InTorch, transfer_function

SIZES = st.sampled_from([size for size in range(4, 400) if steps(size)])


def white(*shape, seed=0, dtype=torch.complex64):
    return torch.randn(shape, dtype=dtype, generator=torch.Generator().manual_seed(seed))


def padded_convolution(field, values):
    """In double precision, of padded arrays."""
    height, width = field.shape[-2:]
    spectrum = torch.fft.fft2(field.to(torch.complex128), s=values.shape) * values
    return torch.fft.ifft2(spectrum)[..., :height, :width]


def relative(found, expected):
    return float((found - expected).norm() / expected.norm())


@given(SIZES, SIZES, st.floats(0, 1), st.floats(0, 1), st.integers(0, 3), st.booleans())
@settings(max_examples=60, deadline=None)
def test_the_kernel_convolves_as_padded_transforms_do(rows, columns, high, wide, images, conjugated):
    values = white(rows, columns, seed=1)
    field = white(*([images] if images else []), 1 + round(high * (rows - 1)), 1 + round(wide * (columns - 1)))
    function = transfer_function(values)
    assert isinstance(function, Fused)
    expected = padded_convolution(field, values.conj() if conjugated else values)
    assert relative(function.convolve(field, conjugated), expected) < 1e-6


@pytest.mark.parametrize("size", [16 * radix for radix in RADICES] + [1350, 2160, 3072, 3840, 16**4 // 8])
def test_long_transforms_keep_single_precision(size):
    values, field = white(4, size, seed=1), white(3, size // 2)
    assert relative(transfer_function(values).convolve(field), padded_convolution(field, values)) < 1e-6


def test_columns_of_zeros_are_left_out_and_change_nothing():
    values = white(40, 480, seed=1)
    values[:, 100:400] = 0
    function, field = transfer_function(values), white(2, 30, 300)
    assert function._tiles.shape[0] < 480 / 16 / 2
    assert relative(function.convolve(field), padded_convolution(field, values)) < 1e-6
    assert torch.allclose(function.values, values, rtol=1e-6)


def test_zeros_pass_nothing_an_empty_batch_stays_empty_and_torchs_default_type_changes_nothing():
    assert not transfer_function(torch.zeros(40, 40, dtype=torch.complex64)).convolve(white(20, 20)).any()
    assert transfer_function(white(60, 60)).convolve(white(0, 30, 30)).shape == (0, 30, 30)
    expected = transfer_function(white(60, 60, seed=1)).convolve(white(30, 30))
    torch.set_default_dtype(torch.float64)
    try:
        assert torch.equal(transfer_function(white(60, 60, seed=1)).convolve(white(30, 30)), expected)
    finally:
        torch.set_default_dtype(torch.float32)


@pytest.mark.parametrize(
    "strided", [lambda u: u.mT, lambda u: u.conj(), lambda u: u[..., ::2], lambda u: u.expand(3, -1, -1)]
)
def test_a_field_may_lie_in_memory_as_it_likes(strided):
    values, field = white(60, 60, seed=1), strided(white(30, 30))
    assert relative(transfer_function(values).convolve(field), padded_convolution(field, values)) < 1e-6


@pytest.mark.parametrize("size", [60, 67])  # by the kernel and by torch
def test_the_result_may_take_the_place_of_a_field_that_is_spent(size):
    function, field = transfer_function(white(size, size, seed=1)), white(2, 30, 40)
    expected = function.convolve(field)
    assert torch.equal(function.convolve(field, spent=True), expected)


@pytest.mark.parametrize("shape", [(61, 20), (20, 61)])
def test_a_field_that_is_larger_than_the_transfer_function_is_refused(shape):
    with pytest.raises(ValueError, match="field is"):
        transfer_function(white(60, 60)).convolve(white(*shape))


def test_a_model_can_be_copied_and_sent_to_another_process():
    model, field = AngularSpectrum((40, 40), 6.4e-6, 517e-9, 0.01), white(40, 40)
    for other in (copy.deepcopy(model), pickle.loads(pickle.dumps(model))):
        assert torch.equal(other.forward(field), model.forward(field))


def test_any_number_of_threads_gives_the_same_bits(monkeypatch):
    monkeypatch.setattr(transfer, "SMALLEST_SHARED", 0)
    function, field, found = transfer_function(white(150, 160, seed=1)), white(3, 70, 81), []
    for threads in (1, 2, 3, 7):
        torch.set_num_threads(threads)
        found.append(function.convolve(field))
    torch.set_num_threads(1)
    assert all(torch.equal(found[0], other) for other in found)


def test_what_lies_around_a_field_in_memory_does_not_matter():
    """A block of rows or columns may reach beyond the field."""
    function, field = transfer_function(white(48, 50, seed=1)), white(17, 19)
    around = torch.full((40, 19), torch.nan, dtype=torch.complex64)
    around[10:27] = field
    assert torch.equal(function.convolve(around[10:27]), function.convolve(field))


@pytest.mark.parametrize(
    "values",
    [white(40, 40, dtype=torch.complex128), white(39 * 2, 40)],
    ids=["double precision", "a size with a prime 13"],
)
def test_torch_does_what_the_kernel_is_not_made_for(values):
    function, field = transfer_function(values), white(20, 20, dtype=values.dtype)
    assert isinstance(function, InTorch)
    assert relative(function.convolve(field), padded_convolution(field, values)) < 1e-6


def test_blocks_of_rows_and_columns_change_nothing(monkeypatch):
    values, field = white(160, 150, seed=1, dtype=torch.complex128), white(2, 3, 70, 50, dtype=torch.complex128)
    expected = padded_convolution(field, values)
    monkeypatch.setattr(transfer, "LARGEST_KEPT", 0)
    for size in (1, 10_000, 2**30):
        monkeypatch.setattr(blocks, "BLOCK_BYTES", size)
        for conjugated in (False, True):
            found = transfer_function(values).convolve(field, conjugated)
            exact = padded_convolution(field, values.conj()) if conjugated else expected
            assert relative(found, exact) < 1e-14


def test_the_model_is_the_same_with_the_kernel_and_without(monkeypatch):
    field = white(70, 51)
    with_kernel = AngularSpectrum((70, 51), 6.4e-6, 517e-9, 0.0123)
    monkeypatch.setattr(transfer, "kernel", lambda: None)
    without = AngularSpectrum((70, 51), 6.4e-6, 517e-9, 0.0123001)  # another one, so that it is not cached
    assert isinstance(without.transfer, InTorch)
    without.transfer = InTorch(with_kernel.transfer.values)
    assert relative(with_kernel.forward(field), without.forward(field)) < 1e-6
    assert relative(with_kernel.adjoint(field), without.adjoint(field)) < 1e-6


def test_a_machine_without_the_compiler_propagates_by_torch():
    code = """
import importlib, os, sys
os.environ["NUMBA_DISABLE_JIT"] = "1"
from holobench_eval.core import compiled
print(compiled.AVAILABLE)
sys.modules["numba"] = None
importlib.reload(compiled)
import torch
from holobench_eval.optics import AngularSpectrum
model = AngularSpectrum((64, 64), 6.4e-6, 517e-9, 0.01)
print(type(model.transfer).__name__, model.forward(torch.ones(64, 64, dtype=torch.complex64)).isfinite().all().item())
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False", "InTorch", "True"]


@given(st.integers(1, 5000))
def test_a_fast_size_is_little_larger_than_what_is_asked(least):
    assert least <= fast_size(least) <= max(1.1 * least, 4)
    assert steps(fast_size(least)) is not None
