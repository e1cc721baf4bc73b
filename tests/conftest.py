"""Settings for every test: one thread, the same examples on every run, no deadlines on a shared machine."""

import os
import signal
from collections.abc import Iterator
from itertools import count
from pathlib import Path

# Read when NumPy is imported. Threads of its OpenBLAS that wait for each other took a quarter of the time of score.
os.environ |= {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}

import matplotlib
import pytest
import torch
from hypothesis import settings

from holobench_eval.commands import run as run_command
from holobench_eval.optics.transfer import kernel
from holobench_eval.study.scoring import reference
from tests.support.studies import fake_study

settings.register_profile("repeatable", deadline=None, derandomize=True)
settings.load_profile("repeatable")
torch.set_num_threads(1)
# A shell that starts the tests in the background has Ctrl-C ignored, and so would all processes that tests interrupt.
signal.signal(signal.SIGINT, signal.default_int_handler)
SHEETS = run_command.sheets
CACHES = count()


def pytest_configure(config: pytest.Config) -> None:
    """The kernel of a fresh clone is compiled once, before all processes of the tests would do so at the same time."""
    if config.getoption("numprocesses", None):  # of the process that starts the others
        kernel()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Files with slow tests come first, so that no worker is left with one at the end."""
    slow = {item.path for item in items if item.get_closest_marker("slow")}
    items.sort(key=lambda item: item.path not in slow)


@pytest.fixture(autouse=True)
def _guards_start_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    """A test with fakes must not leave its digits to one without."""
    monkeypatch.setattr(reference, "_before", {})


@pytest.fixture(autouse=True)
def own_cache(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Timings of tests stay out of the user's cache."""
    folder = tmp_path_factory.mktemp(f"cache-{next(CACHES)}", numbered=False)
    monkeypatch.setenv("MPLCONFIGDIR", matplotlib.get_cachedir())  # else every test would look for the fonts anew
    monkeypatch.setenv("XDG_CACHE_HOME", str(folder))
    return folder


@pytest.fixture(autouse=True, scope="session")
def _no_stage_sheets() -> Iterator[None]:
    """They take seconds for each display of each run; tests that look at them ask for `stage_sheets`."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(run_command, "sheets", lambda *_: [])
        yield


@pytest.fixture
def stage_sheets(monkeypatch: pytest.MonkeyPatch) -> None:
    """A run draws the stages of its displays, as everywhere but in tests."""
    monkeypatch.setattr(run_command, "sheets", SHEETS)


@pytest.fixture
def no_physics(monkeypatch: pytest.MonkeyPatch) -> None:
    """Tasks meet the fake display and the fake score. A test that puts others in their place undoes them in order."""
    fake_study.install(monkeypatch.setattr)
