from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from holobench_eval.study.scoring import prediction


def test_the_hologram_of_a_probe_whose_code_changed_is_another(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[Any] = []
    monkeypatch.setattr(prediction, "_photographed", lambda hologram, *_: asked.append(hologram))
    source = ("charts", "{}", Path(), "tv_lines", "digest")
    job: Any = SimpleNamespace(
        source=lambda cell: source, setting=SimpleNamespace(folder=Path(), isolation="files", limits=None), device="cpu"
    )
    for version in ("before", "before", "after"):
        probe = {"name": "mine.py:Mine", "params": {}, "sha256": version}
        cell: Any = SimpleNamespace(holograms=probe, repeat=0, seed=1, exposure="equal")
        prediction.shown(job, cell, SimpleNamespace())  # type: ignore[arg-type]
    assert asked[0] == asked[1] != asked[2]
