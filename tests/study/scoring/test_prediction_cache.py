from __future__ import annotations

from collections import OrderedDict
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from holobench_eval.study.scoring import prediction


def test_the_hologram_of_a_probe_whose_code_changed_is_another(monkeypatch: pytest.MonkeyPatch) -> None:
    solved: list[Any] = []
    bench = SimpleNamespace(photograph=lambda phase, *_, **__: None)
    monkeypatch.setattr(prediction, "_photographs", OrderedDict())
    monkeypatch.setattr(prediction.opening, "open_display", lambda *_: bench)

    def solve(job: Any, cell: Any, display: Any) -> Any:
        solved.append(cell.holograms["phase"]["code"])
        return SimpleNamespace(phase=None, covered={})

    monkeypatch.setattr(prediction, "_solved", solve)
    job: Any = SimpleNamespace(target=lambda cell, display: None, device="cpu", setting=SimpleNamespace(folder=Path()))
    display: Any = "a display"
    for version in ("before", "before", "after"):
        probe = {"name": "mine.py:Mine", "params": {}, "code": version, "phase": {"code": version}}
        cell: Any = SimpleNamespace(holograms=probe, repeat=0, seed=1, exposure="equal", target="tv_lines")
        prediction.shown(job, cell, display)
    assert solved == ["before", "after"]
