"""Numbers in README and documentation are those of the committed boards."""

from __future__ import annotations

import pytest

from tests.docs.boards import BLOCK, PAGES, ROOT, drawn


@pytest.mark.parametrize("page", PAGES)
def test_a_table_of_a_board_is_drawn_from_it(page: str) -> None:
    text = (ROOT / page).read_text(encoding="utf-8")
    assert BLOCK.search(text)
    assert drawn(text) == text, "draw it: python -m tests.docs.boards"
