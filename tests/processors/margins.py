"""How far from failing each assertion on numbers is, in lines of JSON: a plugin of pytest.

A line is the test, which of its comparisons, and the room that is left: the difference for ``a < b``, and one less the
share of the tolerance for ``approx``, ``allclose`` and ``assert_close``. Below zero the comparison fails.
"""

import json
import os
import sys
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from functools import wraps
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np
import pytest
import torch

FILE = "MARGINS"
_APPROX: Any = type(pytest.approx(1.0))
TESTS = str(Path(__file__).parents[1])
NUMBERS = (int, float, np.number, torch.Tensor)


def _asserted() -> int:
    """The line of the assertion that is being explained, 0 where it is not in these tests."""
    frame: FrameType | None = sys._getframe(2)
    while frame and ("_pytest" in frame.f_code.co_filename or "pluggy" in frame.f_code.co_filename):
        frame = frame.f_back
    return frame.f_lineno if frame and frame.f_code.co_filename.startswith(TESTS) else 0


class Margins:
    """Of the test that runs."""

    def __init__(self, file: Path) -> None:
        self.file, self.test, self.lines, self.met = file, "", list[str](), Counter[str]()

    def tell(self, what: str, room: float) -> None:
        self.met[what] += 1
        self.lines.append(json.dumps([self.test, f"{what} #{self.met[what]}", room]))

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Any:
        self.test = item.nodeid
        self.met.clear()
        return (yield)

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.when == "call" or report.failed:
            self.lines.append(json.dumps([report.nodeid, report.outcome, 0]))

    def pytest_assertion_pass(self) -> None:
        """That it is there makes pytest explain every comparison, to the hook below."""

    def pytest_assertrepr_compare(self, op: str, left: Any, right: Any) -> None:
        if op[0] in "<>" and isinstance(left, NUMBERS) and isinstance(right, NUMBERS) and (line := _asserted()):
            room = float(right) - float(left)
            self.tell(f"line {line}", room if op[0] == "<" else -room)

    def pytest_sessionfinish(self) -> None:
        self.file.write_text("\n".join(self.lines) + "\n", encoding="utf-8")


def _told(margins: Margins, what: str, compare: Callable[..., Any]) -> Callable[..., Any]:
    """A comparison of arrays, whose tolerances are given by name or are its own."""

    @wraps(compare)
    def compared(one: Any, other: Any, *args: Any, **more: Any) -> Any:
        relative, absolute = more.get("rtol"), more.get("atol")
        with suppress(TypeError, ValueError, RuntimeError):  # of more kinds than arrays
            first, second = (
                np.asarray(each.detach() if isinstance(each, torch.Tensor) else each) for each in (one, other)
            )
            allowed = (1e-5 if relative is None else relative) * abs(second) + (1e-8 if absolute is None else absolute)
            if not args and first.shape == second.shape and first.size:
                margins.tell(what, 1 - float(np.max(abs(first - second) / np.maximum(allowed, 1e-300))))
        return compare(one, other, *args, **more)

    return compared


def pytest_configure(config: pytest.Config) -> None:
    """Begin where a file is named."""
    margins = Margins(Path(os.environ[FILE]))
    config.pluginmanager.register(margins)
    equal = _APPROX.__eq__

    def approximate(self: Any, actual: Any) -> bool:
        if isinstance(self.expected, int | float) and isinstance(actual, NUMBERS):
            off, tolerance = abs(float(actual) - float(self.expected)), float(self.tolerance)
            margins.tell("approx", 1 - off / tolerance if tolerance else -off)
        return equal(self, actual)

    _APPROX.__eq__ = approximate
    for module, name in (
        (torch, "allclose"),
        (np, "allclose"),
        (torch.testing, "assert_close"),
        (np.testing, "assert_allclose"),
    ):
        setattr(module, name, _told(margins, name, getattr(module, name)))
