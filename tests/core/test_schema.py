"""One function checks every mapping that comes from a file, whatever the file is."""

from dataclasses import dataclass, field
from typing import Annotated

import pytest
from annotated_types import Interval

from holobench_eval.core.errors import UserError
from holobench_eval.core.schema import FieldError, checked, placed, typed
from holobench_eval.core.yaml_source import parse


@dataclass(frozen=True)
class Lens:
    focus: Annotated[float, Interval(gt=0)] = 1.0
    size: tuple[int, int] = (3, 4)


@dataclass(frozen=True)
class Table:
    name: str
    lens: Lens = field(default_factory=Lens)
    lenses: tuple[Lens, ...] = ()
    digest: str = field(default="", metadata={"key": False})


@pytest.mark.parametrize(
    ("data", "where", "of_a_plug_in", "of_a_file"),
    [
        ({}, ("name",), "table 'x' needs the parameter 'name'", "missing key 'name' in the document"),
        ({"nam": "a"}, ("nam",), "table 'x' has no parameter 'nam'; did you mean 'name'?", "unknown key 'nam' in the"),
        ({"digest": "a"}, ("digest",), "table 'x' has no parameter 'digest'; allowed: lens, lenses, n", "unknown key"),
        (
            {"name": "a", "lens": {"fokus": 1.0}},
            ("lens", "fokus"),
            "table 'x' has no parameter 'lens.fokus'; did you mean 'focus'? allowed: focus, size",
            "unknown key 'fokus' in lens; did you mean 'focus'?",
        ),
        (
            {"name": "a", "lenses": [{}, {"size": [1]}]},
            ("lenses", 1, "size", 1),
            "table 'x' needs the parameter 'lenses.1.size.1'",
            "lenses[1].size has too few values: [1]",
        ),
        (
            {"name": "a", "lens": {"focus": 0}},
            ("lens", "focus"),
            "table 'x': parameter 'lens.focus': input should be greater than 0, got 0",
            "lens.focus should be greater than 0, got 0",
        ),
    ],
)
def test_a_fault_is_one_line_with_its_place_in_the_words_of_its_owner(data, where, of_a_plug_in, of_a_file):
    for owner, line in (("table 'x'", of_a_plug_in), ("", of_a_file)):
        with pytest.raises(FieldError) as caught:
            checked(Table, data, owner)
        assert str(caught.value).startswith(line)
        assert caught.value.where == where
        assert caught.value.at_key == ("has no parameter" in of_a_plug_in)


def test_nested_dataclasses_are_built_and_a_value_that_json_does_not_have_is_refused():
    given = {"name": "a", "lens": {"focus": 2.0}, "lenses": [{"size": [1, 2]}]}
    assert checked(Table, given) == Table("a", Lens(2.0), (Lens(size=(1, 2)),))
    with pytest.raises(UserError, match=r"table 'x': .*set"):
        checked(Table, {"name": {1, 2}}, "table 'x'")


DOCUMENT = """\
name: a
lens: {focus: 0}
"""


def test_a_document_tells_the_line_and_the_column():
    with pytest.raises(UserError, match=r"^table.yaml:2:15: lens.focus should be greater than 0, got 0$"):
        typed(parse("table.yaml", DOCUMENT), Table)


@pytest.mark.parametrize(
    ("error", "position"),
    [
        (FieldError(("focus",), "bad"), "2:15"),
        (FieldError(("focus", 3), "bad", at_key=True), "2:8"),
        (FieldError(("size",), "the file does not give it"), "1:7"),
        (UserError("nothing is known of the place"), "1:7"),
    ],
)
def test_an_error_of_a_plug_in_is_placed_at_its_parameter_or_at_its_name(error, position):
    document = parse("table.yaml", DOCUMENT)
    with pytest.raises(UserError, match=rf"^table.yaml:{position}: {error}$"), placed(document, ("name",), ("lens",)):
        raise error


@pytest.mark.parametrize(
    ("value", "where", "message"),
    [
        (0, (), "level should be greater than 1, got 0"),
        ([3, 0], (1,), "level[1] should be greater than 1, got 0"),
        ([3, "a"], (1,), "level[1] should be a valid number, got"),
        ({"depth": 0}, ("depth",), "level.depth should be greater than 1, got 0"),
    ],
)
def test_a_value_of_several_kinds_has_the_fault_of_the_one_that_it_comes_nearest(value, where, message):
    high = Annotated[float, Interval(gt=1)]

    @dataclass(frozen=True)
    class Deep:
        depth: high

    @dataclass(frozen=True)
    class Many:
        level: high | tuple[high, ...] | Deep = 2.0

    with pytest.raises(FieldError) as error:
        checked(Many, {"level": value})
    assert error.value.where == ("level", *where)
    assert message in str(error.value)
