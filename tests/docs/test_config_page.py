from __future__ import annotations

from tests.docs.config_page import MARK, PAGE, page


def test_the_page_of_the_config_is_that_of_the_schema() -> None:
    text = PAGE.read_text(encoding="utf-8")
    assert MARK in text
    assert text == page(), "write it: python -m tests.docs.config_page"
