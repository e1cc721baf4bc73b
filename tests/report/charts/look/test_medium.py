import pytest

from holobench_eval.report.charts.look.medium import DPI, MEDIA, SCREEN, drawn_for, medium


def test_figures_are_drawn_for_the_screen_unless_another_medium_is_asked_for():
    assert medium() is SCREEN
    with pytest.raises(KeyError), drawn_for(MEDIA["column"]):
        raise KeyError(medium().width)
    assert medium() is SCREEN


@pytest.mark.parametrize(("name", "millimetres"), [("column", 84), ("double", 174)])
def test_figures_for_print_are_as_wide_as_columns_in_type_of_seven_points(name, millimetres):
    column = MEDIA[name]
    assert 0 <= millimetres - column.width / DPI * 25.4 < 0.3
    assert min(column.text, column.note) >= 7


def test_a_medium_holds_within_its_block_alone():
    with drawn_for(MEDIA["double"]):
        assert medium() is MEDIA["double"]
    assert medium() is SCREEN


def test_words_are_wrapped_between_words_and_never_within():
    lines = SCREEN.wrap("double_phase_with_a_long_name and more", 90).splitlines()
    assert lines == ["double_phase_with_a_long_name", "and more"]
