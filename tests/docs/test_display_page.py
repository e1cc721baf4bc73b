from __future__ import annotations

import re

from holobench_eval.core.parameters import parameters
from holobench_eval.display.simulated.profile import Profile
from tests.docs.display_page import MARK, PAGE, page

WORDS = {"name", "version", "seed", "description", "like"}  # keys of no quantity


def test_the_page_of_displays_is_that_of_the_schema() -> None:
    text = PAGE.read_text(encoding="utf-8")
    assert MARK in text
    assert text == page(), "write it: python -m tests.docs.display_page"


def test_every_key_of_a_display_has_a_row_and_every_quantity_a_unit() -> None:
    text = PAGE.read_text(encoding="utf-8")
    for parameter in parameters(Profile):
        *_, key = parameter.name.split(".")
        assert f"\n| `{key}` |" in text, parameter.name
        if "number" in parameter.allowed and key not in WORDS:
            assert re.search(r"\[[^\]]+\]", parameter.meaning), parameter.name


def test_every_stage_has_its_model_with_its_source() -> None:
    text = PAGE.read_text(encoding="utf-8")
    assert "Crosstalk: Gaussian convolution of the phase on sub-samples" in text
    assert text.count("(paper") > 10
