"""What a method's calls read is known: by digest where the study can be held to it, else by name."""

import hashlib
import os
import sys
from importlib.util import cache_from_source
from multiprocessing import Pipe
from pathlib import Path

import cv2
import numpy as np
import pytest
import torch

from holobench_eval.core import reads
from holobench_eval.core.device import CPU
from holobench_eval.core.reads import STARTED, Seen
from holobench_eval.study import isolation
from holobench_eval.study.isolation.messages import Channel, GarbledError
from holobench_eval.study.isolation.process import call
from tests.study.isolation.test_code import apart, inside

METHOD = """
import os
import shutil
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import torch

HERE = Path(__file__).parent
Path({outside!r}, "at_import.txt").read_text()


@dataclass(frozen=True)
class Mine:
    weights: str = {outside!r} + "/weights.bin"
    tables: str = {outside!r} + "/tables"
    log: str = {outside!r} + "/log.txt"

    def solve(self, target, bench):
        np.load(HERE / "array.npy")
        np.memmap(HERE / "mapped.bin")
        torch.load(HERE / "tensors.pt")
        torch.jit.load(HERE / "script.pt")
        cv2.imread(str(HERE / "picture.png"))
        os.close(os.open("by_number.txt", os.O_RDONLY))
        Path(self.tables, "one.txt").read_text()
        Path({outside!r}, "other.txt").read_text()
        try:
            open(HERE / "nothing.txt")
        except FileNotFoundError:
            pass
        Path(self.log).open("a").write("called")
        (HERE / "count.txt").write_text((HERE / "count.txt").read_text() + "1")
        (HERE / "own.txt").write_text("made here")
        (HERE / "own.txt").read_text()
        with tempfile.TemporaryDirectory(dir=HERE) as folder:
            torch.save(target, Path(folder, "own.pt"))
            torch.load(Path(folder, "own.pt"))
        subprocess.run(["true"])
        return 1.0
"""
INSIDE = ("array.npy", "mapped.bin", "tensors.pt", "script.pt", "picture.png", "by_number.txt")


def sha256(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


@pytest.mark.parametrize("build", [inside, apart])
def test_what_a_call_reads_is_covered_or_named(tmp_path, monkeypatch, build):
    study, outside = tmp_path / "study", tmp_path / "outside"
    (outside / "tables").mkdir(parents=True)
    study.mkdir()
    monkeypatch.chdir(study)
    for name in ("at_import.txt", "other.txt", "weights.bin", "tables/one.txt", "tables/two.txt", "log.txt"):
        (outside / name).write_text(name)
    np.save("array.npy", np.zeros(3))
    Path("mapped.bin").write_bytes(bytes(8))
    torch.save(torch.zeros(2), "tensors.pt")
    torch.jit.script(torch.nn.Linear(2, 2)).save("script.pt")
    cv2.imwrite("picture.png", np.zeros((4, 4), np.uint8))
    Path("by_number.txt").write_text("1")
    Path("count.txt").write_text("1")
    Path("mine.py").write_text(METHOD.format(outside=str(outside)))
    method = build(study)
    with isolation.opened(method, CPU) as ready:
        method.solve(2.0, None)
    elsewhere = ("weights.bin", "tables/one.txt", "other.txt")
    named = {str(outside / name): sha256(outside / name) for name in elsewhere}
    assert ready.reads.covered == {name: sha256(study / name) for name in INSIDE} | named | {"nothing.txt": "absent"}
    assert set(ready.reads.uncovered) == {STARTED, str(study / "count.txt")}


def test_a_method_of_this_package_declares_what_it_reads():
    method = isolation.build("double_phase", {}, Path())
    with isolation.opened(method, CPU) as ready:
        Path(__file__).read_text()
    assert ready.reads == isolation.Reads({}, ())


def test_a_file_that_came_changed_or_went_is_named_and_its_time_is_no_matter(tmp_path):
    first, second = tmp_path / "a.txt", tmp_path / "b.txt"
    first.write_text("first")
    covered = {"a.txt": sha256(first), "b.txt": "absent"}
    os.utime(first, (0, 0))
    assert isolation.changed(covered, tmp_path) == ""
    second.write_text("")
    assert isolation.changed(covered, tmp_path) == "b.txt"
    second.unlink()
    first.write_text("other")
    assert isolation.changed(covered, tmp_path) == "a.txt"
    first.unlink()
    assert isolation.changed(covered, tmp_path) == "a.txt"


@pytest.mark.parametrize("prefix", [None, "/cache"])
def test_a_compiled_file_that_is_read_is_its_source(tmp_path, monkeypatch, prefix):
    monkeypatch.setattr(sys, "pycache_prefix", prefix)
    source, seen = tmp_path / "a.py", Seen()
    source.touch()
    seen.note(cache_from_source(str(source)))
    assert list(seen.read) == [str(source)]


FILES = [[], {"a": (1, 2)}, {"a": 1.5}, {1.5: None}]


@pytest.mark.parametrize("told", [None, *({"read": files} for files in FILES), {"written": 3}, {"unseen": 3}])
def test_reads_that_are_no_reads_are_refused(told):
    ours, theirs = Pipe()
    Channel(theirs).send({"result": 1, "seen": told})
    with pytest.raises(GarbledError, match="no reads"):
        call(Channel(ours), Seen(), "solve", {}, ())


def test_what_an_installed_package_reads_as_it_is_imported_is_its_own(tmp_path, monkeypatch):
    installed = tmp_path / "installed" / "a_library_"
    installed.mkdir(parents=True)
    (tmp_path / "cache.txt").write_text("1")
    (installed / "__init__.py").write_text(
        f"from pathlib import Path\nPath({str(tmp_path / 'cache.txt')!r}).read_text()\n"
    )
    (tmp_path / "study").mkdir()
    text = "def Mine(target, bench):\n    import a_library_\n    return target\n"
    (tmp_path / "study" / "mine.py").write_text(text)
    monkeypatch.syspath_prepend(installed.parent)
    places = reads._installed()
    reads.is_installed.cache_clear()
    monkeypatch.setattr(reads, "_installed", lambda: (*places, str(installed.parent)))
    method = inside(tmp_path / "study")
    with isolation.opened(method, CPU) as ready:
        method.solve(2.0, None)
    reads.is_installed.cache_clear()
    assert ready.reads == isolation.Reads()
