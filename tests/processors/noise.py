"""Another processor: the last bits of all that no processor has to round as another does are other ones.

Wider registers add in another order, multiply and add at once, and take a sine by another polynomial. Here what torch,
the kernel of the optics, OpenCV and NumPy compute in such ways is changed by up to one unit in the last place, in
gradients as well. The change is a function of the value and of the processor's number: equal inputs give equal results,
as on a processor. Whole numbers stay, since sums of counts and cosines of zero are exact.

Its size is that of a real change: with ``ATEN_CPU_CAPABILITY=avx2 ONEDNN_MAX_CPU_ISA=AVX2 MKL_CBWR=AVX2`` the goldens
of `hybrid_model` and `hil` moved by 40 and 12 of their tolerances, and by 40 and 10 to 20 with this noise.

``OTHER_PROCESSOR=3 pytest -p tests.processors.noise`` runs tests on the third one, with the processes that the package
starts for them. A program that a test starts by a command line runs on this processor.
"""

import os
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from typing import Any

import cv2
import numpy as np
import pytest
import torch
from torch import Tensor
from torch.utils._python_dispatch import TorchDispatchMode

from holobench_eval.optics.transfer import Grid
from holobench_eval.study.executors import processes

NUMBER, ULPS = "OTHER_PROCESSOR", "OTHER_PROCESSOR_ULPS"
# Every result is a sum of all values: its rounding has the size of their mean, also where they cancel.
TRANSFORMS = "_fft_c2c _fft_r2c _fft_c2r"
# Sums of products, which may cancel.
PRODUCTS = """convolution convolution_backward mm bmm addmm baddbmm addmv mv dot vdot linalg_lstsq linalg_inv_ex
_linalg_solve_ex _linalg_det _linalg_svd linalg_qr"""
# Sums, functions of one value, and products that one instruction or several round.
FUNCTIONS = """sum mean var std var_mean cumsum norm linalg_vector_norm native_batch_norm _native_batch_norm_legit
native_batch_norm_backward native_group_norm native_group_norm_backward native_layer_norm native_layer_norm_backward
avg_pool2d avg_pool2d_backward _adaptive_avg_pool2d _adaptive_avg_pool2d_backward upsample_bilinear2d
upsample_bilinear2d_backward _upsample_bilinear2d_aa _upsample_bilinear2d_aa_backward upsample_bicubic2d
upsample_bicubic2d_backward _upsample_bicubic2d_aa grid_sampler_2d grid_sampler_2d_backward _softmax _log_softmax
logsumexp exp exp2 expm1 log log2 log10 log1p sin cos tan asin acos atan atan2 sinh cosh tanh sigmoid pow polar angle
hypot erf erfc softplus softplus_backward elu elu_backward gelu gelu_backward silu silu_backward tanh_backward
sigmoid_backward sinc rsqrt logaddexp xlogy addcmul addcdiv lerp"""
FEW = 4  # terms are added in one order everywhere
# Of complex numbers alone.
COMPLEX = "mul div abs sgn reciprocal"
ARRAYS = (
    (np.fft, "transform", "fft2 ifft2 rfft2 irfft2"),
    (np.linalg, "product", "inv solve lstsq"),
    (cv2, "product", "GaussianBlur blur resize matchTemplate"),
    (cv2, "sampled", "remap warpPerspective warpAffine"),
    (cv2, "function", "findHomography perspectiveTransform getPerspectiveTransform"),
)


class Processor(TorchDispatchMode):
    """What torch computes within, in threads that begin within too. number: of the processor; ulps: of its noise."""

    def __init__(self, number: int, ulps: float = 1.0) -> None:
        super().__init__()
        self.number, self.ulps = number, ulps

    def __torch_dispatch__(self, func: Any, types: Any, args: Any = (), kwargs: Any = None) -> Any:
        if torch.is_inference_mode_enabled():  # where functions arrive as they were called
            with self:
                result = func.decompose(*args, **(kwargs or {}))
            if result is not NotImplemented:
                return result
        result = func(*args, **(kwargs or {}))
        name = func.overloadpacket.__name__
        kind = _KINDS.get(name if name in _KINDS else name.removesuffix("_"))  # one that works in place
        if name == "pow" and isinstance(args[1], int | float) and args[1] in (0.5, 1, 2):  # rounded alike everywhere
            return result
        if kind and (kind != "complex" or any(isinstance(each, Tensor) and each.is_complex() for each in args)):
            for part in result if isinstance(result, tuple | list) else (result,):
                if isinstance(part, Tensor) and not (name in ("sum", "mean") and args[0].numel() <= FEW * part.numel()):
                    self.change(part, kind)
        return result

    def change(self, values: Tensor, kind: str = "transform") -> None:
        """Other last bits of values, in place: for a transform or products, also of the size of their plane."""
        plane = (-2, -1)[max(0, 2 - values.dim()) :]
        if values.is_complex():
            values, plane = torch.view_as_real(values), tuple(range(-len(plane) - 1, 0))
        if values.dtype not in _BITS or not values.numel():
            return
        bits, factor, shift = _BITS[values.dtype]
        mixed = values.view(bits) * factor + (2 * self.number + 1) * 40503
        mixed = (mixed ^ (mixed >> shift)) * factor
        noise = mixed.to(values.dtype).mul_(self.ulps * torch.finfo(values.dtype).eps / 2 ** (8 * mixed.itemsize - 1))
        size = values.abs()
        if kind in ("transform", "product") and plane:
            # The nearest power of two: the same however the values lie in memory.
            rms = values.square().mean(plane, keepdim=True).sqrt()
            noise *= size.maximum(torch.exp2(rms.clamp_min(1e-30).log2().round()))
            if kind == "product":  # the terms may all be positive
                noise = noise.clamp(-size / 2, size / 2)
        else:
            noise *= size
        values += noise.mul_(values != values.round())

    def changed(self, result: Any, kind: str) -> Any:
        """An array of NumPy, or several, with other last bits."""
        if isinstance(result, tuple):
            for part in result:
                self.changed(part, kind)
        elif isinstance(result, np.ndarray) and result.dtype.kind in "fc" and result.flags.writeable:
            self.change(torch.from_numpy(result), kind)
        return result


_KINDS = {
    name: kind
    for kind, names in (
        ("transform", TRANSFORMS), ("product", PRODUCTS), ("function", FUNCTIONS), ("complex", COMPLEX)
    )
    for name in names.split()
}  # fmt: skip
_BITS = {
    torch.float32: (torch.int32, -1640531535, 15),
    torch.float64: (torch.int64, -7046029254386353131, 31),
}


def _kernel(processor: Processor, which: str) -> Callable[..., None]:
    """What the kernel writes into its last argument is changed."""
    computed = getattr(Grid, which)

    @wraps(computed)
    def other(grid: Grid, tiles: Tensor, result: Tensor) -> None:
        computed(grid, tiles, result)
        processor.change(result)

    return other


def _array(processor: Processor, computed: Callable[..., Any], kind: str) -> Callable[..., Any]:
    @wraps(computed)
    def other(*args: Any, **more: Any) -> Any:
        result = computed(*args, **more)
        if kind != "sampled":
            return processor.changed(result, kind)
        whole_pixels = np.isin(result, args[0])  # weights of one and zeros, which every processor adds exactly
        exact = result[whole_pixels]
        result = processor.changed(result, "product")
        result[whole_pixels] = exact
        return result

    return other


@contextmanager
def another(number: int, ulps: float = 1.0) -> Iterator[Processor]:
    """All that is computed within, by this thread and those that begin within, is as on processor ``number``."""
    processor, run = Processor(number, ulps), threading.Thread.run

    def runs(thread: threading.Thread) -> None:
        with processor:
            run(thread)

    with pytest.MonkeyPatch.context() as patch:
        for which in ("fields", "intensities"):
            patch.setattr(Grid, which, _kernel(processor, which))
        for module, kind, names in ARRAYS:
            for name in names.split():
                patch.setattr(module, name, _array(processor, getattr(module, name), kind))
        patch.setattr(threading.Thread, "run", runs)
        patch.setattr(processes, "PRELOADED", [*processes.PRELOADED, __name__])
        with processor:
            yield processor


if NUMBER in os.environ:  # for as long as the process lives
    _forever = another(int(os.environ[NUMBER]), float(os.environ.get(ULPS, 1)))
    _forever.__enter__()
