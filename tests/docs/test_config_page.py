from __future__ import annotations

from holobench_eval.commands.schema import study_schema
from tests.docs.config_page import PAGE, page


def test_the_page_of_the_config_is_that_of_the_schema() -> None:
    assert PAGE.read_text(encoding="utf-8") == page(), "write it: python -m tests.docs.config_page"


def test_every_key_of_a_config_has_a_row() -> None:
    text = PAGE.read_text(encoding="utf-8")
    for name in study_schema()["properties"]:
        assert f"\n| `{name}` | " in text
