"""Compiled functions are used where they can be: with Numba, on a CPU, without a gradient."""

import pytest
import torch

from holobench_eval.core import compiled


def test_a_gradient_or_another_device_needs_the_uncompiled_form():
    plain, differentiated = torch.zeros(2), torch.zeros(2, requires_grad=True)
    assert compiled.usable(plain)
    assert not compiled.usable(plain, differentiated)
    with torch.no_grad():
        assert compiled.usable(differentiated)
    assert not compiled.usable(torch.zeros(2, device="meta"))


def test_without_numba_a_function_stays_as_it_is(monkeypatch: pytest.MonkeyPatch):
    def double(x):
        return 2 * x

    assert compiled.compiled(double) is not double
    monkeypatch.setattr(compiled, "AVAILABLE", False)
    assert compiled.compiled(double) is double
    assert not compiled.usable()


def test_without_a_folder_for_the_cache_a_function_is_compiled_each_time(monkeypatch: pytest.MonkeyPatch):
    def refuse(cache=False, **options):
        if cache:
            raise RuntimeError("cannot cache function: no locator available")
        return lambda function: "compiled"

    monkeypatch.setattr(compiled, "_compile", refuse)
    assert compiled.compiled(len) == "compiled"
