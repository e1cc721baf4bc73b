"""Files that anybody may have written, read by every command in the same way."""

import os
import warnings
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import torch

from holobench_eval.core.errors import UserError
from holobench_eval.core.io import read_regular, read_text
from holobench_eval.core.yaml_source import load, parse
from holobench_eval.interactive import load_records
from holobench_eval.report.compare.paired import read_run
from holobench_eval.study.artifacts import read_tensors
from holobench_eval.study.config import load_study
from holobench_eval.study.running import provenance
from holobench_eval.study.store import Store
from tests.support.records_on_disk import write_report

READERS: dict[str, tuple[str, Callable[[Path], Any]]] = {
    "a config": ("file", load_study),
    "any YAML": ("file", load),
    "records of a run": ("records.csv", lambda path: read_run(path.parent)),
    "records in Python": ("records.csv", lambda path: load_records(path.parent)),
    "a provenance": ("provenance.json", lambda path: provenance.read(path.parent)),
    "a record": ("file.json", lambda path: Store(path.parents[1]).read("file")),
    "tensors": ("file", read_tensors),
}


@pytest.mark.parametrize("reader", READERS)
@pytest.mark.parametrize("kind", ["pipe", "device", "huge"])
def test_a_file_that_is_none_or_is_huge_is_refused_at_once(reader: str, kind: str, tmp_path: Path) -> None:
    name, read = READERS[reader]
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
