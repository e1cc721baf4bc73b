from __future__ import annotations

from tests.docs.handles_page import MARK, PAGE, page


def test_the_page_of_handles_is_that_of_their_docstrings() -> None:
    text = PAGE.read_text(encoding="utf-8")
    assert MARK in text
    assert text == page(), "write it: python -m tests.docs.handles_page"
