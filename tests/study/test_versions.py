from __future__ import annotations

import importlib
import sys
from pathlib import Path
from typing import Any

import pytest

from holobench_eval.core import plugins
from holobench_eval.methods.wirtinger import Wirtinger
from holobench_eval.study.versions import RECORDED, code_digest, code_of, method_version

METHOD = '''
from dataclasses import dataclass
{imports}

@dataclass(frozen=True)
class Method:
    """{doc}"""

    def solve(self, target, bench):
        return {value}  # {comment}
'''


def code(folder: Path, doc: str = "A method.", value: str = "1", comment: str = "why", imports: str = "") -> str:
    file = folder / "method.py"
    file.write_text(METHOD.format(doc=doc, value=value, comment=comment, imports=imports))
    return code_digest(plugins.find("methods", f"{file}:Method"))


def test_a_method_is_the_same_after_a_change_of_its_words(tmp_path: Path) -> None:
    assert code(tmp_path) == code(tmp_path, doc="Other words.", comment="because")


def test_a_method_is_another_after_a_change_of_its_code(tmp_path: Path) -> None:
    assert code(tmp_path) != code(tmp_path, value="2")


def names(cls: type[Any], folder: Path) -> set[str]:
    """The files that a class's code is in, seen from a folder."""
    return {str(file.relative_to(folder)) for file in code_of(cls)}


PACKAGE = {
    "shop/__init__.py": "",
    "shop/tools.py": "LIMIT = 1",
    "shop/plug/__init__.py": "",
    "shop/plug/method.py": METHOD.format(
        imports="from .deep.first import limit\nfrom . import other\nfrom ..tools import LIMIT",
        doc="A method.",
        value="limit()",
        comment="why",
    ),
    "shop/plug/other.py": "",
    "shop/plug/deep/__init__.py": "",
    "shop/plug/deep/first.py": "from ..second import limit\nfrom ... import tools\nfrom . import whole",
    "shop/plug/deep/whole/__init__.py": "from ....plug.last import END",
    "shop/plug/second.py": "def limit():\n    return 1",
    "shop/plug/last.py": "END = 1",
}


@pytest.fixture
def shop(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A stranger's package with a method that imports at several levels."""
    for name, text in PACKAGE.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    monkeypatch.syspath_prepend(tmp_path)
    for name in [name for name in sys.modules if name.split(".")[0] == "shop"]:
        monkeypatch.delitem(sys.modules, name)
    return tmp_path / "shop" / "plug"


def test_imports_are_followed_at_every_level_within_the_own_folder(shop: Path) -> None:
    method = importlib.import_module("shop.plug.method").Method
    assert names(method, shop) == {
        "__init__.py",
        "method.py",
        "other.py",
        "second.py",
        "last.py",
        "deep/__init__.py",
        "deep/first.py",
        "deep/whole/__init__.py",
    }
    before = code_digest(method)
    (shop.parent / "tools.py").write_text("LIMIT = 2")
    assert code_digest(method) == before
    (shop / "last.py").write_text("END = 2")
    assert code_digest(method) != before


def test_a_shipped_method_is_named_by_its_declared_version(monkeypatch: pytest.MonkeyPatch) -> None:
    assert method_version(Wirtinger) == RECORDED["Wirtinger 1"]
    monkeypatch.setattr(Wirtinger, "version", 2, raising=False)
    assert method_version(Wirtinger) == "Wirtinger 2"


def test_every_recorded_version_is_that_of_a_method_or_older() -> None:
    shipped = {cls.__qualname__: getattr(cls, "version", 1) for cls in map(found, plugins.names("methods"))}
    recorded = [name.split() for name in RECORDED]
    assert all(int(number) <= shipped[name] for name, number in recorded)


def found(name: str) -> type[Any]:
    return plugins.find("methods", name)


MINE = """
from dataclasses import dataclass
from holobench_eval.methods.wirtinger import Wirtinger

@dataclass(frozen=True)
class Method(Wirtinger):
    pass
"""


def test_a_users_method_is_another_after_a_new_version_of_its_shipped_base(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "mine.py").write_text(MINE)
    mine = plugins.find("methods", "mine.py:Method", tmp_path)
    before = method_version(mine)
    monkeypatch.setattr(Wirtinger, "version", 2, raising=False)
    assert method_version(mine) != before


def test_a_users_method_without_code_of_its_own_is_its_shipped_base(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(MINE)
    assert method_version(plugins.find("methods", "mine.py:Method", tmp_path)) == method_version(Wirtinger)
