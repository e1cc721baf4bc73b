"""The one line that a failure is told in."""

import pytest

from holobench_eval.core.errors import (
    BudgetError,
    CellError,
    ForeignError,
    StorageError,
    UserError,
    listed,
    reason,
    suggest,
)
from holobench_eval.report.data.text import words


def test_an_error_is_told_with_the_name_of_its_class_unless_it_is_of_this_package() -> None:
    for kind in (BudgetError, CellError, StorageError, UserError):
        assert reason(kind("registration residual of 1.3 px")) == "registration residual of 1.3 px"
    assert reason(ValueError("no light")) == "ValueError: no light"
    told = type("LinAlgError", (ForeignError,), {})
    assert reason(told("singular matrix")) == "LinAlgError: singular matrix"


def test_a_reason_is_one_short_line_and_never_empty() -> None:
    assert reason(CellError("two\n  lines \udcff")) == "two lines \\udcff"
    assert len(reason(CellError("x" * 400))) == 300
    assert reason(CellError()) == reason(UserError(" \n")) == "no reason given"
    assert reason(KeyboardInterrupt()) == "KeyboardInterrupt:"


def test_words_that_hold_commas_are_told_apart() -> None:
    assert suggest("x", ("b", "a")) == "allowed: a, b"
    assert suggest("x", ("wirtinger", "sgd, tuned")) == "allowed: sgd, tuned; wirtinger"


@pytest.mark.parametrize(
    ("names", "text"),
    [
        ([], ""),
        (["a, x"], "a, x"),
        (["a", "b", "c"], "a, b and c"),
        (["a, x 1", "a, x 2"], "a, x 1; and a, x 2"),
        (["a", "b, x", "c"], "a; b, x; and c"),
        (["a (0.1 dB [0.0, 0.2], p = 1)", "b [1, 2]"], "a (0.1 dB [0.0, 0.2], p = 1) and b [1, 2]"),
    ],
)
def test_a_list_in_a_sentence_is_read_in_one_way(names: list[str], text: str) -> None:
    assert words(names) == text
    assert listed(names) == text.replace("; and ", "; ").replace(" and ", ", ")
