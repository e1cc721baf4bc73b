from __future__ import annotations

import importlib
from pathlib import Path

import pytest

from holobench_eval.core import plugins
from holobench_eval.core.sources import code_of
from holobench_eval.methods.wirtinger import Wirtinger
from holobench_eval.study.versions import method_version


def test_the_code_of_an_installed_method_is_all_of_its_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    files = {"__init__.py", "unused.py", "plug/__init__.py", "plug/method.py", "plug/deep/first.py"}
    for name in files:
        (tmp_path / "a_shop" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "a_shop" / name).write_text("class Method: ...")
    monkeypatch.syspath_prepend(tmp_path)
    assert set(code_of(importlib.import_module("a_shop.plug.method").Method).files) == files


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
