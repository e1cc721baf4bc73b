"""The account of a display's captures: one, whatever a method makes of its handle."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
import torch

from holobench_eval.core.errors import BudgetError, StorageError
from holobench_eval.display import MeteredDisplay
from holobench_eval.display.account import Account, Journal
from tests.display.test_calibrated import Camera
from tests.support.toy_camera import SPEC, ToyDisplay, picture


def handle(budget: int) -> MeteredDisplay:
    return ToyDisplay().handle(Camera(), picture(), budget)


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy])
def test_a_copy_of_the_handle_shares_its_budget(copied: Callable[[MeteredDisplay], MeteredDisplay]) -> None:
    first = handle(3)
    phase = torch.zeros(len(picture()), *SPEC.shape)
    second = copied(first)
    for display in (first, second, copied(second)):
        display.capture(phase)
    assert first.captures == 3
    for display in (first, second):
        with pytest.raises(BudgetError, match="has used its 3 captures"):
            display.capture(phase)


def test_threads_share_a_budget_and_processes_cannot() -> None:
    account = Account("mine", 100)
    with pytest.raises(TypeError, match="another process"):
        pickle.dumps(account)

    def take(_: int) -> bool:
        try:
            account.take()
        except BudgetError:
            return False
        return True

    with ThreadPoolExecutor(8) as pool:
        assert sum(pool.map(take, range(400))) == account.captures == 100


def test_a_journal_has_the_captures_of_all_accounts_and_a_budget_those_of_one(tmp_path: Path) -> None:
    journal = Journal(tmp_path / "new folder" / "one.captures")
    accounts = [Account("mine", 2, journal=journal) for _ in range(2)]
    for account in accounts:
        account.take()
        account.take()
        with pytest.raises(BudgetError, match="has used its 2 captures"):
            account.take()
    assert [(account.captures, account.total) for account in accounts] == [(2, 2), (2, 4)]
    assert journal.captures == 4
    journal.close()
    journal.close()
    assert journal.captures == 0


def test_a_capture_that_cannot_be_counted_is_not_taken(tmp_path: Path) -> None:
    (tmp_path / "journal").touch()
    display, phase = ToyDisplay(), torch.zeros(len(picture()), *SPEC.shape)
    handle = MeteredDisplay(display, "mine", picture(), (), Camera(), journal=Journal(tmp_path / "journal" / "one"))
    with pytest.raises(StorageError, match="journal"):
        handle.capture(phase)
    assert handle.captures == 0
