"""The account of a display's captures: one, whatever a method makes of its handle."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import pytest
import torch

from holobench_eval.core.errors import BudgetError
from holobench_eval.display import MeteredDisplay
from holobench_eval.display.metered import Account
from tests.support.toy_camera import SPEC, ToyDisplay, picture


class Seeing:
    camera = True


def handle(budget: int) -> MeteredDisplay:
    return ToyDisplay().handle(Seeing(), picture(), budget)


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


def test_threads_share_a_budget() -> None:
    account = Account("mine", 100)

    def take(_: int) -> bool:
        try:
            account.take()
        except BudgetError:
            return False
        return True

    with ThreadPoolExecutor(8) as pool:
        assert sum(pool.map(take, range(400))) == account.captures == 100


def test_an_account_is_not_sent_to_another_process() -> None:
    with pytest.raises(TypeError, match="another process"):
        pickle.dumps(Account("mine", 1))
