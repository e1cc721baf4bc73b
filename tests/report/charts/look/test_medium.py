import pytest

from holobench_eval.report.charts.look.medium import MEDIA, SCREEN, drawn_for, medium


def test_figures_are_drawn_for_the_screen_unless_another_medium_is_asked_for():
    assert medium() is SCREEN
    with pytest.raises(KeyError, match="a block of 685"), drawn_for(MEDIA["double"]):
        raise KeyError(f"a block of {medium().width}")
    assert medium() is SCREEN


def test_words_are_wrapped_between_words_and_never_within():
    lines = SCREEN.wrap("double_phase_with_a_long_name and more", 90).splitlines()
    assert lines == ["double_phase_with_a_long_name", "and more"]
