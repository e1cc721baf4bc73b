from __future__ import annotations

import importlib
import sys
from pathlib import Path

import pytest

from holobench_eval.core import plugins
from holobench_eval.core.sources import code_of
from holobench_eval.methods.wirtinger import Wirtinger
from holobench_eval.study.versions import method_version

METHOD = '''
from dataclasses import dataclass
{imports}

@dataclass(frozen=True)
class Method:
    """A method."""

    def solve(self, target, bench):
        return 1
'''

PACKAGE = {
    "shop/__init__.py": "",
    "shop/tools.py": "LIMIT = 1",
    "shop/unused.py": "",
    "shop/plug/__init__.py": "",
    "shop/plug/method.py": METHOD.format(imports="from .deep.first import limit\nfrom ..tools import LIMIT"),
    "shop/plug/deep/__init__.py": "",
    "shop/plug/deep/first.py": "from ..second import limit\nfrom . import whole",
    "shop/plug/deep/whole/__init__.py": "def late():\n    from ....plug.last import END",
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
    return tmp_path / "shop"


def test_the_code_of_an_installed_method_is_what_is_imported_of_its_package(shop: Path) -> None:
    method = importlib.import_module("shop.plug.method").Method
    names = {name.removeprefix("shop/") for name in PACKAGE}
    assert set(code_of(method).files) == names


@pytest.mark.parametrize("file", ["tools.py", "plug/last.py", "plug/method.py"])
def test_an_installed_method_is_another_after_an_edit_of_its_package(shop: Path, file: str) -> None:
    versions = []
    for _ in range(2):
        for name in [name for name in sys.modules if name.split(".")[0] == "shop"]:
            del sys.modules[name]
        importlib.invalidate_caches()
        versions.append(method_version(importlib.import_module("shop.plug.method").Method))
        (shop / file).write_text((shop / file).read_text() + "# more")
    assert versions[0] != versions[1]


def test_a_shipped_method_is_named_by_its_declared_version(monkeypatch: pytest.MonkeyPatch) -> None:
    assert method_version(Wirtinger) == "Wirtinger 1"
    monkeypatch.setattr(Wirtinger, "version", 2, raising=False)
    assert method_version(Wirtinger) == "Wirtinger 2"


MINE = """
from dataclasses import dataclass
from holobench_eval.methods.wirtinger import Wirtinger

@dataclass(frozen=True)
class Method(Wirtinger):
    pass
"""


def version(folder: Path, name: str = "Method") -> str:
    return method_version(plugins.find("methods", f"mine.py:{name}", folder))


def test_a_users_method_is_another_after_a_new_version_of_its_shipped_base(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "mine.py").write_text(MINE)
    before = version(tmp_path)
    monkeypatch.setattr(Wirtinger, "version", 2, raising=False)
    assert version(tmp_path) != before


def test_a_shipped_class_under_the_name_of_a_file_is_that_files(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(MINE)
    assert len(version(tmp_path, "Wirtinger")) == 64
    assert method_version(Wirtinger) == "Wirtinger 1"
