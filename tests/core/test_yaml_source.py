from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from holobench_eval.core.errors import UserError
from holobench_eval.core.yaml_source import LARGEST_BYTES, load, parse


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
