"""Pages and tables of the documentation are what the code and the committed reports say."""

import re
from types import ModuleType

import pytest

from holobench_eval.core.parameters import parameters
from holobench_eval.display.simulated.profile import Profile
from tests.docs import config_page, display_page, handles_page
from tests.docs.boards import BLOCK, PAGES, ROOT, TIMED, drawn

WORDS = {"name", "version", "seed", "description", "like"}  # keys of no quantity


@pytest.mark.parametrize("page", PAGES)
def test_a_table_is_drawn_from_its_report(page: str) -> None:
    text = (ROOT / page).read_text(encoding="utf-8")
    assert BLOCK.search(text) or TIMED.search(text)
    assert drawn(text) == text, "draw it: python -m tests.docs.boards"


@pytest.mark.parametrize("module", [config_page, display_page, handles_page])
def test_a_page_is_that_of_schema_and_docstrings(module: ModuleType) -> None:
    assert module.PAGE.read_text(encoding="utf-8") == module.page(), f"write it: python -m {module.__name__}"


def test_every_key_of_a_display_has_a_row_and_every_quantity_a_unit() -> None:
    text = display_page.page()
    for parameter in parameters(Profile):
        *_, key = parameter.name.split(".")
        assert f"\n| `{key}` |" in text, parameter.name
        if "number" in parameter.allowed and key not in WORDS:
            assert re.search(r"\[[^\]]+\]", parameter.meaning), parameter.name


def test_every_stage_has_its_model_with_its_source() -> None:
    text = display_page.page()
    assert "Crosstalk: Gaussian convolution of the phase on sub-samples" in text
    assert text.count("(paper") > 10
