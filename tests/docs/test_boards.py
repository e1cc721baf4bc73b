"""Numbers in README and documentation are those of the committed reports."""

from __future__ import annotations

import pytest

from tests.docs.boards import BLOCK, PAGES, ROOT, TIMED, drawn


@pytest.mark.parametrize("page", PAGES)
def test_a_table_is_drawn_from_its_report(page: str) -> None:
    text = (ROOT / page).read_text(encoding="utf-8")
    assert BLOCK.search(text) or TIMED.search(text)
    assert drawn(text) == text, "draw it: python -m tests.docs.boards"
