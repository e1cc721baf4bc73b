"""Files that anybody may have written: one function checks every mapping, and every command reads them in one way."""

import itertools
import os
import warnings
import zipfile
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import pytest
import torch
from annotated_types import Interval
from hypothesis import given
from hypothesis import strategies as st

from holobench_eval.core.errors import UserError
from holobench_eval.core.io import read_regular, read_text
from holobench_eval.core.schema import FieldError, Metres, checked, kinds_of, metres, placed, typed
from holobench_eval.core.yaml_source import LARGEST_BYTES, load, parse
from holobench_eval.display import load_profile
from holobench_eval.display.simulated.profile import Profile
from holobench_eval.interactive import load_records
from holobench_eval.lab.bench_file import BenchFile, load_bench_file
from holobench_eval.report.compare import read_run
from holobench_eval.study.artifacts import read_tensors
from holobench_eval.study.config import load_study
from holobench_eval.study.definition import Study
from holobench_eval.study.running import provenance
from holobench_eval.study.store import Store
from tests.support.records_on_disk import write_report


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


def test_every_key_and_value_knows_its_place() -> None:
    document = parse("a.yaml", "one: 1\ntwo:\n  - three\n  - {four: 5}\n")
    assert document.data == {"one": 1, "two": ["three", {"four": 5}]}
    assert document.keys[("two",)] == (2, 1)
    assert document.values[("two", 0)] == (3, 5)
    assert document.keys[("two", 1, "four")] == (4, 6)
    assert document.values[("two", 1, "four")] == (4, 12)
    absent = document.error(("two", 1, "missing", 4), "what")
    assert str(absent) == "a.yaml:4:5: what"  # the place of what encloses it


def test_scalars_follow_the_core_schema() -> None:
    document = parse("a.yaml", "{a: 1e-3, b: yes, c: 010, d: 1:30, e: 2020-01-01, f: ~, g: .5, h: True, i: '1'}")
    assert list(document.data.values()) == [0.001, "yes", 10, "1:30", "2020-01-01", None, 0.5, True, "1"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "a.yaml:1:1: the file is empty"),
        ("- 1", "a.yaml:1:1: the file is not a mapping"),
        ("a: 1\nb: 2\na: 3", "a.yaml:3:1: duplicate key 'a'; first given in line 1"),
        ("a: &x 1\nb: *x", "a.yaml:2:4: aliases"),
        ("a: .nan", "a.yaml:1:4: '.nan' is not a finite number"),
        ("a: 1e999", "a.yaml:1:4: '1e999' is not a finite number"),
        ("a: !!python/object:os.system {}", "a.yaml:1:4: values of the kind"),
        ("? [1]\n: 2", "a.yaml:1:3: a key must be a plain word"),
        ("a: 1\n---\nb: 2", "a.yaml:2:1: expected a single document"),
        ("a: [1", "a.yaml:1:6: while parsing a flow sequence"),
        ("a: " + "[" * 1000, "a.yaml:1:23: nested deeper than 20 levels"),
        ("a: \x07", "a.yaml: not YAML: unacceptable character"),
    ],
)
def test_a_faulty_document_is_one_line_with_its_place(text: str, message: str) -> None:
    with pytest.raises(UserError) as caught:
        parse("a.yaml", text)
    assert str(caught.value).startswith(message)
    assert "\n" not in str(caught.value)


def test_an_alias_bomb_is_refused_at_its_first_alias() -> None:
    lines = ["a0: &a0 [x, x]"] + [f"a{i}: &a{i} [*a{i - 1}, *a{i - 1}]" for i in range(1, 50)]
    with pytest.raises(UserError, match=r"^a\.yaml:2:"):
        parse("a.yaml", "\n".join(lines))


def test_files_that_are_no_configs_are_refused(tmp_path: Path) -> None:
    large, binary = tmp_path / "large.yaml", tmp_path / "binary.yaml"
    large.write_text("a: " + "x" * LARGEST_BYTES)
    binary.write_bytes(b"\xff\xfe")
    for path, message in (
        (tmp_path / "absent.yaml", "no such file"),
        (tmp_path, "Is a directory"),
        (large, "larger than"),
        (binary, "no YAML, since not UTF-8 text"),
    ):
        with pytest.raises(UserError, match=message):
            load(path)


@given(st.text(max_size=80))
def test_any_text_gives_a_mapping_or_one_line(text: str) -> None:
    assert isinstance(outcome(text), dict) or "\n" not in str(outcome(text))


def outcome(text: str) -> object:
    try:
        return parse("a.yaml", text).data
    except UserError as error:
        return str(error)


COMMANDS: dict[str, tuple[str, Callable[[Path], Any]]] = {
    "a config": ("file", load_study),
    "any YAML": ("file", load),
    "records of a run": ("records.csv", lambda path: read_run(path.parent)),
    "records in Python": ("records.csv", lambda path: load_records(path.parent)),
    "a provenance": ("provenance.json", lambda path: provenance.read(path.parent)),
    "a record": ("file.json", lambda path: Store(path.parents[1]).read("file")),
    "tensors": ("file", read_tensors),
}


@pytest.mark.parametrize("reader", COMMANDS)
@pytest.mark.parametrize("kind", ["pipe", "device", "huge"])
def test_a_file_that_is_none_or_is_huge_is_refused_at_once(reader: str, kind: str, tmp_path: Path) -> None:
    name, read = COMMANDS[reader]
    path = tmp_path / "records" / name
    path.parent.mkdir()
    if kind == "pipe":
        os.mkfifo(path)
    elif kind == "device":
        path.symlink_to("/dev/zero")
    else:
        with path.open("wb") as file:
            file.truncate(10**11)  # sparse: it takes no room
    with pytest.raises(UserError) as caught:
        read(path)
    assert str(path) in str(caught.value)
    assert ("larger than" if kind == "huge" else "a pipe or a device; expected a regular file") in str(caught.value)


def test_a_file_is_read_up_to_its_limit_and_closed(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_bytes("a\r\né\n".encode())
    with warnings.catch_warnings(record=True) as said:  # of files that stay open
        warnings.simplefilter("always")
        assert read_regular(path, 6) == path.read_bytes()
        assert read_text(path, 6) == "a\né\n"
    assert not said
    with pytest.raises(UserError, match="larger than"):
        read_regular(path, 5)
    path.write_bytes(b"a\xff")
    with pytest.raises(UserError, match=r"file: not UTF-8 text \(invalid start byte at byte 1\)"):
        read_text(path, 6)


def test_tensors_that_would_be_unpacked_to_more_than_the_file_are_refused(tmp_path: Path) -> None:
    plain, packed = tmp_path / "plain.pt", tmp_path / "packed.pt"
    torch.save({"x": torch.zeros(100_000)}, plain)
    assert torch.equal(read_tensors(plain)["x"], torch.zeros(100_000))
    with zipfile.ZipFile(plain) as source, zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as target:
        for entry in source.infolist():
            target.writestr(entry.filename, source.read(entry))
    with pytest.raises(UserError, match=r"packed\.pt: damaged, or .* unpacked to"):
        read_tensors(packed)


@pytest.mark.parametrize("sign", ["\x1b[2J", "\u202e"])
@pytest.mark.parametrize("column", ["label", "condition", "target", "reason"])
def test_records_that_would_control_a_terminal_are_refused(column: str, sign: str, tmp_path: Path) -> None:
    folder = write_report(tmp_path, {("toy", "bench"): [None, 20.0]})
    path, value = folder / "records.csv", {"label": "toy", "condition": "bench", "target": "t0", "reason": "no light"}
    path.write_text(path.read_text().replace(value[column], value[column] + sign))
    with pytest.raises(UserError, match="holds control characters; take them out") as caught:
        read_run(folder)
    assert str(caught.value).isprintable()


@pytest.mark.parametrize("text", ['title: "a\\e[2Jb"', '"a\\u202E": 1', 'methods: [{label: "a\\x9b"}]'])
def test_a_config_that_would_control_a_terminal_is_refused_at_its_place(text: str) -> None:
    with pytest.raises(UserError, match=r"a\.yaml:1:\d+: .* holds control characters; take them out") as caught:
        parse("a.yaml", text)
    assert str(caught.value).isprintable()
    assert parse("a.yaml", 'note: "two\\n\\tlines"').data == {"note": "two\n\tlines"}
