"""A command as a person calls it."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from tests.commands.test_commands import holoeval


@pytest.fixture
def call(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Callable[..., tuple[int, str, str]]:
    """Calls a command: its exit code, and what it prints, last of it the errors."""

    def called(*arguments: object) -> tuple[int, str, str]:
        return holoeval(monkeypatch, *arguments), *capsys.readouterr()

    return called
