"""A cell's target is loaded once for all methods and repeats, and nobody can spoil it for the next."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import torch

from holobench_eval.core.errors import CellError
from holobench_eval.datasets.charts import Charts
from holobench_eval.study.scoring.job import TargetSource, load_target

FOLDER = Path("of this test")


def source(item: str, params: str = "{}", sha256: str = "") -> TargetSource:
    return "charts", "", params, FOLDER, item, sha256 or Charts().digest(item)


def place(side: int) -> Any:
    return SimpleNamespace(spec=SimpleNamespace(region=SimpleNamespace(shape=(side, side)), wavelengths=(1, 2, 3)))


def test_a_target_is_loaded_once_and_given_unspoiled(monkeypatch):
    loads: list[tuple[str, tuple[int, int]]] = []
    load = Charts.load

    def counted(self: Charts, item: str, shape: tuple[int, int], channels: int = 3) -> torch.Tensor:
        loads.append((item, shape))
        return load(self, item, shape, channels)

    monkeypatch.setattr(Charts, "load", counted)
    first = load_target(source("tv_lines"), place(40))
    first.zero_()
    other = load_target(source("gray_ramp", '{"names":["gray_ramp"]}'), place(40))
    assert torch.equal(other, load(Charts(), "gray_ramp", (40, 40)))
    assert load_target(source("tv_lines"), place(48)).shape == (3, 48, 48)
    again = load_target(source("tv_lines"), place(40))
    assert torch.equal(again, load(Charts(), "tv_lines", (40, 40)))
    assert loads == [("tv_lines", (40, 40)), ("gray_ramp", (40, 40)), ("tv_lines", (48, 48))]


def test_a_target_that_changed_since_the_plan_is_refused():
    with pytest.raises(CellError, match="'tv_lines' has changed since the study was planned"):
        load_target(source("tv_lines", sha256="another"), place(40))


def test_a_target_that_is_black_is_refused_before_anything_is_solved(monkeypatch):
    monkeypatch.setattr(Charts, "load", lambda self, item, shape, channels=3: torch.zeros(channels, *shape))
    with pytest.raises(CellError, match="target 'tv_lines' is black; expected light in at least one of its colours"):
        load_target(source("tv_lines"), place(33))
