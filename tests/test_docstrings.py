"""The examples in the docstrings of the public surface run, and its parameters are documented."""

from __future__ import annotations

import doctest
import importlib
import inspect
import pkgutil
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from types import ModuleType
from typing import Any

import pytest
import torch

from holobench_eval import core, datasets, display, imaging, methods, metrics, optics
from holobench_eval.display.simulated import pipeline, profile

ROOMS = (core, datasets, methods, optics, imaging, metrics, display)
DOCUMENTED = [
    *((optics, name) for name in optics.__all__ if name != "Propagator"),
    *((imaging, name) for name in ("Registration", "Refined", "fiducial", "refine", "register")),
    *((metrics, name) for name in ("Metric", "match", "score")),
    *((display, name) for name in display.__all__ if name != "Display"),
    (pipeline, "SimulatedBench"),
    (profile, "load_profile"),
]


def modules() -> Iterator[str]:
    for room in ROOMS:
        yield room.__name__
        yield from (module.name for module in pkgutil.walk_packages(room.__path__, f"{room.__name__}."))


@pytest.mark.parametrize("name", list(modules()))
def test_examples_run(name: str) -> None:
    torch.manual_seed(0)
    module = importlib.import_module(name)
    failed, _ = doctest.testmod(module, extraglobs={"torch": torch}, optionflags=doctest.NORMALIZE_WHITESPACE)
    assert failed == 0


@pytest.mark.parametrize(("module", "name"), DOCUMENTED, ids=lambda value: getattr(value, "__name__", value))
def test_parameters_of_the_public_surface_are_documented(module: ModuleType, name: str) -> None:
    documented: Any = getattr(module, name)
    text = inspect.getdoc(documented) or ""
    assert "Parameters\n----------" in text
    section = text.split("Parameters\n----------\n")[1].split("\n\n")[0]
    names = {name.strip() for line in section.splitlines() if not line.startswith(" ") for name in line.split(",")}
    assert names
    if inspect.isfunction(documented):
        assert names == set(inspect.signature(documented).parameters)
    elif is_dataclass(documented) and documented is not display.Profile:  # whose stages are many
        assert names == {field.name for field in fields(documented)}


def test_metrics_document_parameters_values_and_errors() -> None:
    for metric in metrics.catalogue():
        function: Any = getattr(metric.function, "func", metric.function)
        text = inspect.getdoc(function) or ""
        assert all(title in text for title in ("Parameters\n", "Returns\n", "Raises\n")), metric.name
