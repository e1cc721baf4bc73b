from __future__ import annotations

from pathlib import Path

import fake_study
import matplotlib
import pytest


@pytest.fixture(autouse=True)
def own_cache(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Timings of tests stay out of the user's cache."""
    folder = tmp_path_factory.mktemp("cache")
    monkeypatch.setenv("MPLCONFIGDIR", matplotlib.get_cachedir())  # else every test would look for the fonts anew
    monkeypatch.setenv("XDG_CACHE_HOME", str(folder))
    return folder


@pytest.fixture
def no_physics(monkeypatch: pytest.MonkeyPatch) -> None:
    """Tasks meet the fake display and the fake score."""
    for module, name, _ in fake_study.FAKES:
        monkeypatch.setattr(module, name, getattr(module, name))  # put back after the test
    fake_study.install()
