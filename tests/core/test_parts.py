from pathlib import Path

import pytest

from holobench_eval.core.errors import UserError
from holobench_eval.core.parts import load_config
from holobench_eval.core.yaml_source import dump, parse
from tests.study.studies import one_line

FILE = """\
# what the file is for
title: A study
targets: {dataset: crops, params: {size: 208}}
methods: [wirtinger, sgd]
note: Only of the first.

parts:
  frames:
    title: Frames
    targets: {dataset: crops}
    note: null
  1080p: {methods: [sgd]}
"""


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "depth.yaml"
    path.write_text(FILE)
    return path


def test_a_part_has_the_keys_of_the_first_study_but_for_its_own_and_for_those_that_it_removes(file):
    own = {"title": "Frames", "targets": {"dataset": "crops"}, "methods": ["wirtinger", "sgd"]}
    assert load_config(file / "frames").data == own
    assert load_config(file / "1080p").data["methods"] == ["sgd"]


@pytest.mark.parametrize("name", ["", "frames", "1080p"])
def test_the_text_of_a_study_holds_its_own_keys_and_stands_alone(file, name):
    document = load_config(file / name)
    data = {key: value for key, value in document.data.items() if key != "parts"}
    assert parse("", document.text).data == data
    file.write_text(file.read_text().replace("  1080p: {methods: [sgd]}\n", "  another: {title: Another}\n"))
    if name != "1080p":
        assert load_config(file / name).text == document.text


def test_a_file_without_parts_keeps_its_text_and_its_comments(file):
    file.write_text(FILE.partition("\nparts:")[0])
    assert load_config(file).text == file.read_text()


def test_a_fault_in_a_part_is_told_at_its_own_line_and_one_of_the_first_study_at_that_of_the_first(file):
    document = load_config(file / "frames")
    for where, line in ((("title",), 9), (("targets", "dataset"), 10), (("methods", 1), 4), ((), 9), (("note",), 11)):
        assert str(document.error(where, "odd")).startswith(f"{file}:{line}:"), where


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("  1080p:", '  "..":', "12:3: '..' is no name of a part; take lower-case letters, digits and single hyphens"),
        ("  1080p:", "  a/b:", "12:3: 'a/b' is no name"),
        ("  1080p:", "  Frames:", "12:3: 'Frames' is no name"),
        ("  1080p:", "  figures:", "12:3: 'figures' is what a report has itself; take"),
        ("  1080p:", "  records:", "12:3: 'records' is what"),
        ("  1080p: {methods: [sgd]}", "  other:", "12:9: part 'other' should be a mapping of the keys that differ"),
        ("{methods: [sgd]}", "{parts: {}}", "12:11: a part has no parts"),
    ],
)
def test_a_name_that_no_folder_may_have_and_what_is_no_part_are_refused_in_one_line(file, old, new, message):
    file.write_text(FILE.replace(old, new))
    for config in (file, file / "frames"):
        with one_line(at=f"{file}:{message}"):
            load_config(config)


@pytest.mark.parametrize(
    ("config", "message"),
    [
        ("depth.yaml/frame", "depth.yaml: no part 'frame'; did you mean 'frames'? allowed: 1080p, frames"),
        ("depth.yaml/frames/x", "depth.yaml/frames/x: no such file"),
        ("dept.yaml/frames", "dept.yaml/frames: no such file"),
    ],
)
def test_a_part_or_a_file_that_is_not_there_is_told_in_one_line(file, config, message):
    with one_line(message):
        load_config(Path(file.parent, config))
    file.write_text(FILE.partition("\nparts:")[0])
    with pytest.raises(UserError, match=r"no part 'frames'; it has no parts$"):
        load_config(file / "frames")


def test_any_plain_value_is_written_and_read_as_itself():
    words = ["yes", "null", "3", "1e-3", "1.5", "~", "# x", "a: b", "", " a ", "two\nlines", "é", "-", "[", "20-1-1"]
    numbers = [1, -2, 1e-5, 1e20, 0.1, True, None]
    data = {"words": words, "numbers": numbers, "inner": {"3": {"a": []}, "yes": "x " * 200}}
    assert parse("", dump(data)).data == data
