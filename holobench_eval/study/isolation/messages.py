"""What goes over the pipe between the harness and a method's process: JSON, and the raw numbers of tensors behind it.

Neither side runs code by what it reads, as it would with a pickle.
"""

from __future__ import annotations

import json
import threading
from collections.abc import Mapping
from dataclasses import fields
from math import prod
from multiprocessing.connection import Connection
from typing import Any

import numpy as np
import torch
from torch import Tensor

from ...core.errors import CellError
from ...display.api import Capture, DisplaySpec, Region
from ...display.estimates import Estimate
from ...display.phases import is_plain, type_name
from ...display.training import TrainingImage

LONGEST_HEADER, LARGEST_TENSOR = 64 * 2**20, 8 * 2**30  # bytes that are read
NUMBERS = "float16 bfloat16 float32 float64 complex64 complex128 bool uint8 int8 int16 int32 int64"
TYPES: dict[str, torch.dtype] = {name: getattr(torch, name) for name in NUMBERS.split()}
CLASSES: dict[str, type[Any]] = {cls.__name__: cls for cls in (Capture, DisplaySpec, Estimate, Region, TrainingImage)}
LISTS: dict[str, type[Any]] = {cls.__name__: cls for cls in (list, tuple, set, frozenset)}


class GarbledError(CellError):
    """The other side sent what is no message."""


class Channel:
    """An end of a pipe for numbers, text, tensors, lists and mappings of them, and the classes of ``CLASSES``.

    A tensor arrives on the CPU, without its gradient. Every function raises EOFError or OSError where the other end is
    gone.
    """

    def __init__(self, connection: Connection) -> None:
        self.connection = connection
        self.lock = threading.RLock()  # to be held from a request to its answer

    def send(self, value: Any) -> None:
        """Send a value. CellError, and nothing is sent, for one that holds anything else."""
        tensors: list[Tensor] = []
        header = json.dumps(_plain(value, tensors)).encode()
        with self.lock:
            self.connection.send_bytes(header)
            for tensor in tensors:
                self.connection.send_bytes(tensor.view(torch.uint8).numpy().data)

    def receive(self) -> Any:
        """The next value. GarbledError for what is no message."""
        try:
            return self._value(json.loads(self.connection.recv_bytes(LONGEST_HEADER)))
        except (ValueError, TypeError, LookupError, RuntimeError, OSError) as error:
            if getattr(error, "errno", None) is not None:  # the end is gone; without a number there is too much to read
                raise
            raise GarbledError(f"no message: {error}") from None

    def _value(self, content: Any) -> Any:
        if not isinstance(content, list):
            return content
        kind, *items = content
        if kind == "tensor":
            dtype, shape = TYPES[items[0]], items[1]
            size = prod(shape) * dtype.itemsize
            if min(shape, default=0) < 0 or size > LARGEST_TENSOR:
                raise ValueError(f"a tensor of shape {shape}")
            numbers = np.frombuffer(bytearray(self.connection.recv_bytes(size)), np.uint8)
            return torch.from_numpy(numbers).view(dtype).clone().reshape(shape)
        if kind == "class":
            return CLASSES[items[0]](**self._value(items[1]))
        if kind == "dict":
            return {self._value(key): self._value(item) for key, item in items}
        return LISTS[kind](self._value(item) for item in items)


def _plain(value: Any, tensors: list[Tensor]) -> Any:
    """A value as JSON has it, all but numbers and text as a list that begins with what it is; its tensors apart."""
    if value is None or type(value) in (bool, int, float, str):
        return value
    if isinstance(value, np.generic):  # a number of NumPy's
        return _plain(value.item(), tensors)
    if is_plain(value) and str(value.dtype).removeprefix("torch.") in TYPES:
        tensor = value.detach().cpu().resolve_conj().resolve_neg().contiguous()
        tensors.append(tensor.reshape(-1))
        return ["tensor", str(tensor.dtype).removeprefix("torch."), list(tensor.shape)]
    if isinstance(value, tuple):  # a shape, or one with names
        value = tuple(value)
    name = type(value).__name__
    if type(value) is LISTS.get(name):
        return [name, *(_plain(item, tensors) for item in value)]
    if isinstance(value, Mapping):
        return ["dict", *([_plain(key, tensors), _plain(item, tensors)] for key, item in value.items())]
    if type(value) is CLASSES.get(name):
        return ["class", name, _plain({field.name: getattr(value, field.name) for field in fields(value)}, tensors)]
    raise CellError(f"a value is {type_name(value)}; expected tensors, numbers, text, lists or mappings of them")
