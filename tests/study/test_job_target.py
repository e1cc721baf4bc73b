"""A cell's target is loaded once for its repeats, and nobody can spoil it for the next."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import torch

from holobench_eval.datasets.charts import Charts
from holobench_eval.study.job import target_of


def cell(target: str, **changes: Any) -> Any:
    known = {"dataset": "charts", "dataset_params": {}, "target": target, "target_sha256": Charts().digest(target)}
    return SimpleNamespace(**(known | changes))


def place(side: int) -> Any:
    return SimpleNamespace(spec=SimpleNamespace(region=SimpleNamespace(shape=(side, side)), wavelengths=(1, 2, 3)))


def test_repeats_load_a_target_once_and_get_it_unspoiled(monkeypatch: pytest.MonkeyPatch) -> None:
    loads: list[tuple[str, tuple[int, int]]] = []
    load = Charts.load

    def counted(self: Charts, item: str, shape: tuple[int, int], channels: int = 3) -> torch.Tensor:
        loads.append((item, shape))
        return load(self, item, shape, channels)

    monkeypatch.setattr(Charts, "load", counted)
    folder = Path("of this test")
    first = target_of(cell("tv_lines"), place(40), folder)
    first.zero_()
    again = target_of(cell("tv_lines"), place(40), folder)
    assert torch.equal(again, load(Charts(), "tv_lines", (40, 40)))
    assert loads == [("tv_lines", (40, 40))]
    assert target_of(cell("tv_lines"), place(48), folder).shape == (3, 48, 48)
    other = cell("gray_ramp", dataset_params={"names": ["gray_ramp"]})
    assert torch.equal(target_of(other, place(40), folder), load(Charts(), "gray_ramp", (40, 40)))
    assert len(loads) == 3
