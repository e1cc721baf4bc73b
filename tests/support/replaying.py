"""A device that replays recorded operations as a CUDA graph does; its memory is the CPU's."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, field
from typing import Any, TypeVar

import pytest
import torch
from torch import Tensor
from torch.utils._python_dispatch import TorchDispatchMode
from torch.utils._pytree import tree_leaves

from holobench_eval.core import compiled, graphs
from holobench_eval.display import api
from holobench_eval.imaging.shifts import correlate
from holobench_eval.metrics import base
from holobench_eval.optics import angular_spectrum, transfer

T = TypeVar("T")
aten = torch.ops.aten
WAITING = {
    *(aten._local_scalar_dense.default, aten.equal.default, aten.nonzero.default, aten.masked_select.default),
    *(aten.repeat_interleave.Tensor, aten.unique_dim.default, aten._unique2.default, aten.bincount.default),
    aten.lift_fresh.default,  # a tensor of Python's numbers, which are copied to the device
}
"""Operations after which the host knows a number of the device, or the size of a result that depends on one."""


def tensors(values: object) -> list[Tensor]:
    return [value for value in tree_leaves(values) if isinstance(value, Tensor)]


def memory(tensor: Tensor) -> int:
    return tensor.untyped_storage().data_ptr()


def written(func: Any, args: Any, kwargs: Any) -> list[Tensor]:
    """The tensors that an operation writes to, by its declaration."""
    names = [argument.name for argument in func._schema.arguments]
    given = dict(zip(names, args, strict=False)) | kwargs
    declared = [argument for argument in func._schema.arguments if argument.alias_info and argument.alias_info.is_write]
    return tensors([given.get(argument.name) for argument in declared])


class Watch(TorchDispatchMode):
    """RuntimeError for an operation that a CUDA graph cannot hold, since the host would wait for the device."""

    def __torch_dispatch__(self, func: Any, types: Any, args: Any = (), kwargs: Any = None) -> Any:
        masks = args[1] if func in (aten.index.Tensor, aten.index_put_.default, aten._unsafe_index.Tensor) else []
        if func in WAITING or any(mask.dtype == torch.bool for mask in tensors(masks)):
            raise RuntimeError(f"{func} waits for the device")
        return self.run(func, args, kwargs or {})

    def run(self, func: Any, args: Any, kwargs: Any) -> Any:
        return func(*args, **kwargs)


@dataclass
class Operation:
    """An operation, its arguments, and what it returned; ``new``: that has memory of its own."""

    func: Any
    args: Any
    kwargs: Any
    returned: list[Tensor]
    new: list[bool]


class Tape(Watch):
    """Records operations, which are undone in the end: a graph is recorded without running."""

    def __init__(self) -> None:
        super().__init__()
        self.operations: list[Operation] = []
        self._own: set[int] = set()
        self._before: dict[int, tuple[Tensor, Tensor]] = {}

    def run(self, func: Any, args: Any, kwargs: Any) -> Any:
        for tensor in written(func, args, kwargs):
            if memory(tensor) not in self._own | self._before.keys():
                whole = torch.empty(0, dtype=torch.uint8).set_(tensor.untyped_storage())
                self._before[memory(tensor)] = whole, whole.clone()
        result = func(*args, **kwargs)
        if func.namespace == "aten":
            given, returned = {memory(tensor) for tensor in tensors((args, kwargs))}, tensors(result)
            new = [memory(tensor) not in given for tensor in returned]
            self._own |= {memory(tensor) for tensor, own in zip(returned, new, strict=True) if own}
            kept = [tensor.detach() for tensor in returned]  # a step may ask for gradients later
            self.operations.append(Operation(func, args, kwargs, kept, new))
        return result

    def undo(self) -> None:
        for whole, before in self._before.values():
            whole.copy_(before)

    @torch.no_grad()
    def replay(self) -> None:
        for operation in self.operations:
            again = tensors(operation.func(*operation.args, **operation.kwargs))
            for old, value, new in zip(operation.returned, again, operation.new, strict=True):
                if new:
                    old.copy_(value)


@dataclass
class Fake:
    """The recorder of this device; it counts what it does."""

    counts: dict[str, int]
    records: bool = True
    tape: Tape = field(default_factory=Tape)

    def run(self, step: Callable[[], T], watched: bool = False) -> T:
        self.counts["runs"] += 1
        with Watch() if watched else nullcontext():
            return step()

    def record(self, step: Callable[[], T]) -> T:
        if not self.records:
            raise RuntimeError("this device does not record")
        self.counts["records"] += 1
        with self.tape:
            result = step()
        self.tape.undo()
        return result

    def replay(self) -> None:
        self.counts["replays"] += 1
        self.tape.replay()


@contextmanager
def fake_device(records: bool = True) -> Iterator[dict[str, int]]:
    """Let the CPU be such a device, or (``records``) one that fails to record; counts of runs, records and replays.

    What a GPU cannot run, compiled code and OpenCV, is hidden: it would work on the memory unseen.
    """
    counts = dict.fromkeys(("runs", "records", "replays"), 0)
    caches = angular_spectrum._band_limited_transfer, angular_spectrum._cut_off_transfer, api._propagator
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(graphs, "RECORDERS", {"cpu": lambda device: Fake(counts, records)})
        patch.setattr(compiled, "AVAILABLE", False)
        patch.setattr(transfer, "kernel", lambda: None)
        patch.setattr(base, "_opencv_filtered", lambda image, taps: correlate(correlate(image, taps, -1), taps, -2))
        for cache in caches:
            cache.cache_clear()
        yield counts
    for cache in caches:  # what torch is to do here, the kernel does elsewhere
        cache.cache_clear()
