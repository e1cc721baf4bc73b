"""The examples in the documentation of core are run, so that they stay true."""

import doctest
import importlib

import pytest


@pytest.mark.parametrize(
    "name", ["core.io", "core.plugins", "core.schema", "core.seeds", "core.yaml_source", "datasets.base"]
)
def test_documented_examples_are_true(name: str) -> None:
    ran = doctest.testmod(importlib.import_module(f"holobench_eval.{name}"))
    assert ran.attempted > 0
    assert ran.failed == 0
