"""A device that is not the CPU, on a computer that has none: torch's device "meta", whose tensors hold no values."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor
from torch.utils._python_dispatch import TorchDispatchMode
from torch.utils._pytree import tree_leaves

ELSEWHERE = torch.device("meta")
aten = torch.ops.aten
REFUSED = {
    *(aten.histc.default, aten.kthvalue.default, aten.median.dim, aten.cumsum.default, aten.bincount.default),
    *(aten.reflection_pad1d_backward.default, aten.reflection_pad2d_backward.default),
    *(aten.grid_sampler_2d_backward.default, aten.upsample_bilinear2d_backward.default),
    *(aten.upsample_bicubic2d_backward.default, aten._adaptive_avg_pool2d_backward.default),
    *(aten.adaptive_max_pool2d_backward.default, aten.nll_loss_forward.default, aten.put_.default),
}
"""What torch has no deterministic form of on a GPU (``torch.use_deterministic_algorithms``), and so refuses there."""


class Elsewhere(TorchDispatchMode):
    """Every operation of torch is watched, backward ones too: as on a GPU, none may mix tensors of two devices, none
    may be in ``REFUSED``.

    Numbers of the CPU (tensors without dimensions) may be mixed in. What is read from the device, which has no values,
    is zero, but for the states of random numbers (bytes) that were brought there; a single number is 1, a truth True
    and a count 0.
    """

    def __torch_dispatch__(self, func: Any, types: Any, args: Any = (), kwargs: Any = None) -> Any:
        kwargs = kwargs or {}
        tensors = [one for one in tree_leaves((args, kwargs)) if isinstance(one, Tensor)]
        if func is aten._to_copy.default:
            to = torch.device(kwargs.get("device") or args[0].device)
            if to.type == "cpu" and args[0].device == ELSEWHERE:
                nothing = torch.zeros(args[0].shape, dtype=kwargs.get("dtype") or args[0].dtype)
                return getattr(args[0], "brought", nothing)
            there = func(*args, **kwargs)
            if args[0].dtype == torch.uint8:
                there.brought = args[0]
            return there
        if func is aten.copy_.default:
            return args[0].zero_() if args[1].device == ELSEWHERE else func(*args, **kwargs)
        devices = {one.device.type for one in tensors if one.ndim}
        if func in REFUSED and ELSEWHERE.type in devices:
            raise AssertionError(f"{func} has no deterministic form on a GPU")
        if len(devices) > 1:
            raise AssertionError(f"{func} mixes devices: {[(one.device.type, tuple(one.shape)) for one in tensors]}")
        if func is aten._local_scalar_dense.default and args[0].device == ELSEWHERE:
            number = args[0].dtype
            return True if number == torch.bool else 1.0 if number.is_floating_point else 0
        if func in (aten._fused_adam_.default, aten._fused_adam_.tensor_lr) and ELSEWHERE.type in devices:
            assert all(one.device == ELSEWHERE for one in tensors)  # its counts of steps and its rate as well
            return None
        return func(*args, **kwargs)
