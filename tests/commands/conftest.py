"""A command as a person calls it, and where it computes."""

import pytest

from holobench_eval.study import executors
from tests.commands.test_commands import holoeval


@pytest.fixture
def call(monkeypatch, capsys):
    """Calls a command: its exit code, and what it prints, last of it the errors."""

    def called(*arguments: object) -> tuple[int, str, str]:
        return holoeval(monkeypatch, *arguments), *capsys.readouterr()

    return called


@pytest.fixture
def in_process(monkeypatch):
    """A run computes in the process of the tests, as on one core: workers begin with nothing open."""
    monkeypatch.setattr(executors, "_cores", lambda: 1)
