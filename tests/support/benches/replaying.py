"""A device that replays recorded operations as a CUDA graph does; its memory is the CPU's."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass
from typing import Any

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

aten = torch.ops.aten
WAITING = {
    *(aten._local_scalar_dense.default, aten.equal.default, aten.nonzero.default, aten.masked_select.default),
    *(aten.repeat_interleave.Tensor, aten.unique_dim.default, aten._unique2.default, aten.bincount.default),
    aten.lift_fresh.default,  # a tensor of Python's numbers, which are copied to the device
}
"""Operations after which the host knows a number of the device, or the size of a result that depends on one."""

OVERWRITING = {aten.copy_.default, aten.zero_.default, aten.fill_.Scalar, aten.fill_.Tensor}
"""Operations that do not read what they write to."""


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


class Traffic(TorchDispatchMode):
    """Counts bytes that operations read and write, each argument and each result once, as if no cache kept any."""

    def __init__(self) -> None:
        super().__init__()
        self.bytes = 0

    def __torch_dispatch__(self, func: Any, types: Any, args: Any = (), kwargs: Any = None) -> Any:
        kwargs = kwargs or {}
        result = func(*args, **kwargs)
        shared = {memory(tensor) for tensor in tensors((args, kwargs))}
        read = tensors((args[1:] if func in OVERWRITING else args, {**kwargs, "out": None}))
        changed = written(func, args, kwargs)
        new = [tensor for tensor in tensors(result) if memory(tensor) not in shared]
        if changed or (new and "empty" not in func.__name__):  # else a view, or room
            self.bytes += sum(tensor.numel() * tensor.element_size() for tensor in read + changed + new)
        return result


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


class FakeStream:
    """A stream that notes for which others it waits."""

    def __init__(self, name: str, waits: list[tuple[str, str]]) -> None:
        self.name, self.waits = name, waits

    def wait_stream(self, other: FakeStream) -> None:
        self.waits.append((self.name, other.name))


class FakeCuda:
    """What ``graphs`` uses of ``torch.cuda``, with the memory of the CPU; it counts.

    records: whether a recording succeeds. Where one fails, its stream stays the current one, as in torch.
    """

    def __init__(self, records: bool = True) -> None:
        self.succeeds, self.records, self.replays, self.watches = records, 0, 0, 0
        self.waits: list[tuple[str, str]] = []
        self.current = self.usual = FakeStream("usual", self.waits)
        self._watch: Watch | None = None

    def device(self, device: torch.device) -> AbstractContextManager[None]:
        return nullcontext()

    def new_stream(self) -> FakeStream:
        return FakeStream("own", self.waits)

    def new_graph(self) -> FakeGraph:
        return FakeGraph(self)

    def current_stream(self, device: torch.device) -> FakeStream:
        return self.current

    @contextmanager
    def stream(self, stream: FakeStream) -> Iterator[None]:
        before, self.current = self.current, stream
        try:
            yield
        finally:
            self.current = before

    @contextmanager
    def graph(self, graph: FakeGraph, stream: FakeStream) -> Iterator[None]:
        self.current = stream
        assert self._watch is None
        try:
            with graph.tape:
                yield
        finally:
            graph.tape.undo()
        if not self.succeeds:
            raise RuntimeError("the recording has failed")
        self.records += 1

    def get_sync_debug_mode(self) -> int:
        return 2 if self._watch else 0

    def set_sync_debug_mode(self, mode: int | str) -> None:
        if self._watch is not None:
            self._watch.__exit__(None, None, None)
        self._watch = Watch() if mode == "error" else None
        if self._watch is not None:
            self.watches += 1
            self._watch.__enter__()


class FakeGraph:
    """A graph of the operations of a tape."""

    def __init__(self, cuda: FakeCuda) -> None:
        self.tape, self._cuda = Tape(), cuda

    def replay(self) -> None:
        assert self._cuda.current is self._cuda.usual
        self._cuda.replays += 1
        self.tape.replay()


@contextmanager
def fake_device(kind: str = "cpu", records: bool = True) -> Iterator[FakeCuda]:
    """Let a type of device be a GPU that records steps, or (``records``) one that fails to.

    What a GPU cannot run, compiled code and OpenCV, is hidden: it would work on the memory unseen.
    """
    cuda = FakeCuda(records)
    caches = angular_spectrum._band_limited_transfer, angular_spectrum._cut_off_transfer, api._free_space
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(graphs, "RECORDERS", {kind: graphs.CudaGraph})
        for name in ("device", "current_stream", "stream", "graph", "get_sync_debug_mode", "set_sync_debug_mode"):
            patch.setattr(torch.cuda, name, getattr(cuda, name))
        patch.setattr(torch.cuda, "Stream", cuda.new_stream)
        patch.setattr(torch.cuda, "CUDAGraph", cuda.new_graph)
        patch.setattr(compiled, "AVAILABLE", False)
        patch.setattr(transfer, "kernel", lambda: None)
        patch.setattr(base, "_opencv_filtered", lambda image, taps: correlate(correlate(image, taps, -1), taps, -2))
        for cache in caches:
            cache.cache_clear()
        yield cuda
    for cache in caches:  # what torch is to do here, the kernel does elsewhere
        cache.cache_clear()
