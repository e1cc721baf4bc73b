"""A method finds the same names in a process of its own as inside."""

from __future__ import annotations

import inspect
from typing import Any

import pytest

from holobench_eval.display.metered import MeteredDisplay
from holobench_eval.display.training import TrainingBench
from holobench_eval.study.isolation.handles import REQUESTS, SolvingHandle, TrainingHandle

PAIRS = [(MeteredDisplay, SolvingHandle), (TrainingBench, TrainingHandle)]


def public(cls: type[Any]) -> set[str]:
    """Public members of a class and what its ``__init__`` sets."""
    set_there = {
        name
        for base in cls.__mro__
        if "__init__" in vars(base) and base is not object
        for name in vars(base)["__init__"].__code__.co_names
        if not isinstance(vars(base).get(name), type) and f"self.{name}" in inspect.getsource(vars(base)["__init__"])
    }
    return {name for name in {*dir(cls), *set_there} if not name.startswith("_")}


@pytest.mark.parametrize(("inside", "apart"), PAIRS)
def test_both_handles_have_the_same_public_names(inside, apart):
    assert public(inside) == public(apart)
    assert set(REQUESTS[inside]) <= public(inside)


@pytest.mark.parametrize(("inside", "apart"), PAIRS)
def test_functions_of_both_handles_take_the_same_arguments(inside, apart):
    for name in public(inside):
        ours, theirs = getattr(inside, name, None), getattr(apart, name, None)
        if inspect.isfunction(ours):
            assert inspect.isfunction(theirs)
            given = [list(inspect.signature(function).parameters) for function in (ours, theirs)]
            assert given[0] == given[1], name
