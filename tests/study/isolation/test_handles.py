"""A method finds the same names in a process of its own as inside; what is sent and taken between the two."""

import inspect
from contextlib import nullcontext
from types import SimpleNamespace
from typing import Any

import pytest

from holobench_eval.display import load_profile
from holobench_eval.display.metered import MeteredDisplay
from holobench_eval.display.training import TrainingBench
from holobench_eval.study import isolation
from holobench_eval.study.isolation import process
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
def test_both_handles_have_the_same_public_names_and_their_functions_the_same_arguments(inside, apart):
    assert public(inside) == public(apart)
    assert set(REQUESTS[inside]) <= public(inside)
    for name in public(inside):
        ours, theirs = getattr(inside, name, None), getattr(apart, name, None)
        if inspect.isfunction(ours):
            assert inspect.isfunction(theirs)
            given = [list(inspect.signature(function).parameters) for function in (ours, theirs)]
            assert given[0] == given[1], name


def test_a_row_of_a_training_may_have_any_names(tmp_path):
    sent: list[dict[str, Any]] = []
    channel: Any = SimpleNamespace(lock=nullcontext(), send=sent.append, receive=lambda: {"value": None})
    known = {"spec": load_profile("ideal").spec((128, 128)), "images": (), "held_out": ()}
    TrainingHandle(channel, known).log(name=1, step=2)
    assert sent == [{"ask": "log", "args": (), "named": {"name": 1, "step": 2}}]


def test_only_what_a_method_may_declare_is_taken_from_it(tmp_path, monkeypatch):
    flags = {"camera": True, "timed": False, "solve": "mine", "_call": None}
    facts = process.Facts("Mine", "", flags, ["solve"], "", None, 0.0, True)
    monkeypatch.setattr(process, "process_of", lambda *_: SimpleNamespace(facts=facts))
    cls = isolation.find("mine.py:Mine", tmp_path)
    traits = isolation.traits("mine.py:Mine", tmp_path)
    assert (traits.camera, traits.timed) == (True, True)
    assert callable(cls.solve)
    assert cls._call is isolation.Apart._call
