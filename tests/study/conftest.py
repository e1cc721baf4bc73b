from __future__ import annotations

from pathlib import Path

import fake_study
import pytest

from holobench_eval.study import cell


@pytest.fixture(autouse=True)
def own_cache(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Timings of tests stay out of the user's cache."""
    folder = tmp_path_factory.mktemp("cache")
    monkeypatch.setenv("XDG_CACHE_HOME", str(folder))
    return folder


@pytest.fixture
def no_physics(monkeypatch: pytest.MonkeyPatch) -> None:
    """Tasks meet the fake display and the fake score."""
    for name in ("workbench", "score"):
        monkeypatch.setattr(cell, name, getattr(cell, name))  # put back after the test
    fake_study.install()
