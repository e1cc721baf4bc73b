"""Methods from files: imported once as long as they stay the same."""

import sys
from pathlib import Path

from holobench_eval import registry

METHOD = """
import dataclasses, sys
sys.imports_of_this_file = getattr(sys, "imports_of_this_file", 0) + 1

@dataclasses.dataclass
class Mine:
    number: int = {number}

    def solve(self, target, bench): ...
"""


def test_a_file_is_imported_once_while_it_stays_the_same(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(sys, "imports_of_this_file", 0, raising=False)
    (tmp_path / "mine.py").write_text(METHOD.format(number=1))
    built = [registry.build("methods", "mine.py:Mine", {}, tmp_path) for _ in range(3)]
    assert [one.number for one in built] == [1, 1, 1]
    assert type(built[0]) is type(built[2])
    assert sys.imports_of_this_file == 1


def test_a_file_that_was_edited_is_imported_again(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(METHOD.format(number=1))
    assert registry.build("methods", "mine.py:Mine", {}, tmp_path).number == 1
    (tmp_path / "mine.py").write_text(METHOD.format(number=22))
    assert registry.build("methods", "mine.py:Mine", {}, tmp_path).number == 22


def test_equal_files_in_two_folders_are_two_modules(tmp_path: Path) -> None:
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "mine.py").write_text(METHOD.format(number=1))
    first, second = (registry.find("methods", "mine.py:Mine", tmp_path / name) for name in ("a", "b"))
    assert first is not second
