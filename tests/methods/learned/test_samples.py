"""Samples of several kinds are asked for together."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import pytest
import torch

from holobench_eval.core.errors import Pending
from holobench_eval.methods.learned.samples import Sample, together

SAMPLE = Sample(*(torch.zeros(1),) * 4)


def kind(name: str, asked: list[str], waits: bool) -> Callable[[], Sequence[Sample]]:
    def make() -> Sequence[Sample]:
        asked.append(name)
        if waits:
            raise Pending(name)
        return [SAMPLE]

    return make


def test_every_kind_is_asked_for_before_the_first_that_waits_says_so() -> None:
    asked: list[str] = []
    with pytest.raises(Pending, match=r"^b$"):
        together(kind("a", asked, False), kind("b", asked, True), kind("c", asked, True))
    assert asked == ["a", "b", "c"]


def test_kinds_that_are_there_follow_each_other() -> None:
    assert together(kind("a", [], False), kind("b", [], False)) == [SAMPLE, SAMPLE]
