"""The examples in the docstrings of the methods run."""

import doctest
import importlib

import pytest
import torch

MODULES = ("common", "descent", "double_phase", "learned.samples")


@pytest.mark.parametrize("module", MODULES)
def test_the_examples_run(module: str) -> None:
    loaded = importlib.import_module(f"holobench_eval.methods.{module}")
    results = doctest.testmod(loaded, extraglobs={"torch": torch})
    assert results.attempted
    assert not results.failed
