"""Steps that a GPU repeats: recorded once as a CUDA graph and replayed.

A step of a retrieval is some fifty operations, and Python starts each of them in about ten microseconds: on a fast GPU
that takes longer than the work. A graph starts them all at once.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Mapping
from typing import TypeVar

import torch

T = TypeVar("T")

WARM_UP = 2
"""Runs of a step before it is watched and recorded: in them is made what is made once, such as the state of an
optimiser, plans of transforms and constants."""


class CudaGraph:
    """Runs, records and replays one step on a GPU of NVIDIA.

    https://docs.pytorch.org/docs/stable/notes/cuda.html#cuda-graphs
    """

    def __init__(self, device: torch.device) -> None:
        self._device = device
        with torch.cuda.device(device):
            self._stream, self._graph = torch.cuda.Stream(), torch.cuda.CUDAGraph()

    def run(self, step: Callable[[], T], watched: bool = False) -> T:
        """Run a step; watched: RuntimeError where it waits for a number of the device.

        On the stream that the step is recorded on, as libraries keep workspaces for each.
        """
        current, mode = torch.cuda.current_stream(self._device), torch.cuda.get_sync_debug_mode()
        self._stream.wait_stream(current)
        with warnings.catch_warnings(), torch.cuda.stream(self._stream):
            warnings.filterwarnings("ignore", "Synchronization debug mode")  # that it does not see everything
            warnings.filterwarnings("ignore", "This instance was constructed with capturable=True")
            torch.cuda.set_sync_debug_mode("error" if watched else mode)
            try:
                return step()
            finally:
                torch.cuda.set_sync_debug_mode(mode)
                current.wait_stream(self._stream)

    def record(self, step: Callable[[], T]) -> T:
        """Record the operations of a step without running them; what it returned, which each replay fills anew.

        RuntimeError for a step that cannot be recorded.
        """
        # The outer context gives the stream back even where the end of a failed recording raises.
        with torch.cuda.stream(self._stream), torch.cuda.graph(self._graph, stream=self._stream):
            return step()

    def replay(self) -> None:
        """Run the operations that were recorded, on the same memory."""
        self._graph.replay()


RECORDERS: Mapping[str, Callable[[torch.device], CudaGraph]] = {"cuda": CudaGraph}
"""By type of device; on others, steps run as they are."""


def is_recorded(device: torch.device) -> bool:
    """Whether ``repeated`` records steps on a device: they should then keep their results in the same memory, and read
    no number, for which they would wait until the device has done all its work."""
    return device.type in RECORDERS


def repeated(step: Callable[[], T], device: torch.device) -> Callable[[], T]:
    """A function to call in the place of ``step``, again and again: on a GPU its operations are recorded and replayed.

    On the CPU, and where the step waits for a number of the device, it is ``step`` itself that runs. Where it waits,
    it is started once more: it must do so before it changes anything. What it changes besides tensors of the device is
    changed by the recorded run for the last time. What it returns must be read before the next call.
    """
    recorder = RECORDERS.get(device.type)
    if recorder is None:
        return step
    results = _results(step, recorder(device))
    return lambda: next(results)


def _results(step: Callable[[], T], recorder: CudaGraph) -> Iterator[T]:
    for _ in range(WARM_UP):
        yield recorder.run(step)
    try:
        # A recording that fails leaves torch's random numbers of a GPU unusable: what would make it fail is looked for.
        first = recorder.run(step, watched=True)
    except RuntimeError:
        pass  # it waits for the device, and runs as it is from here on, where a fault of its own is raised again
    else:
        yield first
        del first
        try:
            result = recorder.record(step)
        except RuntimeError:
            pass  # it cannot be recorded, or there is no memory for that: as it is, too, where its faults are raised
        else:
            while True:
                recorder.replay()
                yield result
    while True:
        yield step()
