"""What a method sends to the process that holds the display, and what the harness takes from a method's process."""

from __future__ import annotations

from contextlib import nullcontext
from types import SimpleNamespace
from typing import Any

from holobench_eval.display import load_profile
from holobench_eval.study import isolation
from holobench_eval.study.isolation import process
from holobench_eval.study.isolation.handles import TrainingHandle


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
    assert isolation.traits("mine.py:Mine", tmp_path).camera
    assert isolation.traits("mine.py:Mine", tmp_path).timed
    assert callable(cls.solve)
    assert cls._call is isolation.Apart._call
