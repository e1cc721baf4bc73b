"""One function checks every mapping that comes from a file, whatever the file is."""

import itertools
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import pytest
from annotated_types import Interval
from hypothesis import given
from hypothesis import strategies as st

from holobench_eval.core.errors import UserError
from holobench_eval.core.schema import FieldError, Metres, checked, kinds_of, metres, placed, typed
from holobench_eval.core.yaml_source import parse
from holobench_eval.display import load_profile
from holobench_eval.display.simulated.profile import Profile
from holobench_eval.lab.bench_file import BenchFile, load_bench_file
from holobench_eval.study.config import load_study
from holobench_eval.study.definition import Study


@dataclass(frozen=True)
class Lens:
    focus: Annotated[float, Interval(gt=0)] = 1.0
    size: tuple[int, int] = (3, 4)


@dataclass(frozen=True, kw_only=True)
class Table:
    lens: Lens = field(default_factory=Lens)
    lenses: tuple[Lens, ...] = ()
    digest: str = field(default="", metadata={"key": False})
    name: str


@pytest.mark.parametrize(
    ("data", "where", "of_a_plug_in", "of_a_file"),
    [
        ({}, ("name",), "table 'x' needs the parameter 'name'", "missing key 'name' in the document"),
        ({"nam": "a"}, ("nam",), "table 'x' has no parameter 'nam'; did you mean 'name'?", "unknown key 'nam' in the"),
        ({"digest": "a"}, ("digest",), "table 'x' has no parameter 'digest'; allowed: lens, lenses, n", "unknown key"),
        (
            {"lens": {"fokus": 1}},
            ("lens", "fokus"),
            "table 'x' has no parameter 'lens.fokus'",
            "unknown key 'fokus' in",
        ),
        (
            {"lenses": [{}, {"size": [1]}]},
            ("lenses", 1, "size", 1),
            "table 'x' needs the parameter 'lenses.1",
            "lenses[1]",
        ),
        (
            {"lens": {"focus": 0}},
            ("lens", "focus"),
            "table 'x': parameter 'lens.focus': input should be",
            "lens.focus sh",
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
    assert checked(Table, given) == Table(name="a", lens=Lens(2.0), lenses=(Lens(size=(1, 2)),))
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


@pytest.mark.parametrize(
    ("low", "high", "given_", "says"),
    [
        (200e-9, 2000e-9, 532.0, "532 is not in 200e-9 to 2e-6 m; lengths are in metres: 532e-9"),
        (200e-9, 2000e-9, 0.532, "; lengths are in metres: 0.532e-6"),
        (0.5e-6, 200e-6, 8.0, "8 is not in 500e-9 to 200e-6 m; lengths are in metres: 8e-6"),
        (0.1e-3, 10.0, 100.0, "100 is not in 100e-6 to 10 m; lengths are in metres: 100e-3"),
        (0.1e-3, 10.0, 0.0, "0 is not in 100e-6 to 10 m"),
        (0.1e-3, 10.0, -3.0, "-3 is not in 100e-6 to 10 m"),
    ],
)
def test_a_length_in_another_unit_is_refused_with_its_value_in_metres(low, high, given_, says):
    fault = Metres(low, high).fault(given_)
    assert fault.endswith(says)
    assert ("; " in fault) == ("; " in says)


@given(st.floats(201e-9, 1999e-9), st.sampled_from([1e3, 1e6, 1e9]))
def test_the_remedy_is_in_the_range_and_what_was_meant(length, unit):
    assert Metres(200e-9, 2000e-9).fault(length) == ""
    remedy = Metres(200e-9, 2000e-9).fault(length * unit).rpartition(": ")[2]
    assert float(remedy) == pytest.approx(length, rel=1e-5)


@given(st.floats(1e-9, 100))
def test_a_length_reads_back_as_it_was_written(length):
    assert float(metres(length)) == pytest.approx(length, rel=1e-5)


READERS = {
    "a study": load_study,
    "a real bench": load_bench_file,
    "a simulated display": lambda path: load_profile(str(path)),
}
FILES = {
    "a study": "title: s\ntargets: {dataset: photographs}\nmethods: [wirtinger]\n",
    "a real bench": "name: b\nslm: {driver: monitor}\ncamera: {driver: files}\n",
    "a simulated display": "like: ideal\nname: d\nsensor: {bits: 12}\n",
}


@pytest.mark.parametrize(("kind", "wanted"), list(itertools.permutations(READERS, 2)))
def test_a_file_of_another_kind_is_refused_for_its_kind(kind: str, wanted: str, tmp_path: Path) -> None:
    path = tmp_path / "file.yaml"
    path.write_text(FILES[kind])
    with pytest.raises(UserError, match=f"describes {kind}; expected {wanted}"):
        READERS[wanted](path)


def test_each_kind_is_that_of_its_own_keys() -> None:
    for kind, cls in zip(READERS, (Study, BenchFile, Profile), strict=True):
        assert kinds_of(cls.__dataclass_fields__)[0] == kind
