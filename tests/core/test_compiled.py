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


def test_a_function_is_compiled_without_a_folder_for_a_cache_and_stays_as_it_is_without_numba(
    monkeypatch: pytest.MonkeyPatch,
):
    def double(x):
        return 2 * x

    def refuse(cache=False, **options):  # as Numba does where it finds no folder for its cache
        if cache:
            raise RuntimeError("cannot cache function: no locator available")
        return lambda function: "compiled each time"

    assert compiled.compiled(double) is not double
    with monkeypatch.context() as without_folder:
        without_folder.setattr(compiled, "_compile", refuse)
        assert compiled.compiled(double) == "compiled each time"
    monkeypatch.setattr(compiled, "AVAILABLE", False)
    assert compiled.compiled(double) is double
    assert not compiled.usable()
