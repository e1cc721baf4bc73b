from __future__ import annotations

import importlib
import math
import sys
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from holobench_eval import registry
from holobench_eval.errors import UserError
from holobench_eval.study.identity import canonical, code_digest, code_of, digest

METHOD = '''
from dataclasses import dataclass
{imports}

@dataclass(frozen=True)
class Method:
    """{doc}"""

    def solve(self, target, bench):
        return {value}  # {comment}
'''

PLAIN = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3),
    max_leaves=8,
)


def code(folder: Path, doc: str = "A method.", value: str = "1", comment: str = "why", imports: str = "") -> str:
    file = folder / "method.py"
    file.write_text(METHOD.format(doc=doc, value=value, comment=comment, imports=imports))
    return code_digest(registry.find("methods", f"{file}:Method"))


def test_a_digest_does_not_change_between_versions() -> None:
    assert digest({"b": [1, 2.5, "x"], "a": None}) == "cacedc786abc936ff5388c20aad7a580a43bd81efb4e8df98d138f3816b04bab"


@given(st.dictionaries(st.text(), PLAIN, max_size=5))
def test_a_digest_does_not_depend_on_the_order_of_keys(description: dict[str, object]) -> None:
    assert digest(dict(reversed(description.items()))) == digest(description)


@pytest.mark.parametrize("odd", [math.nan, math.inf, object(), b"bytes"])
def test_what_is_not_plain_has_no_digest(odd: object) -> None:
    with pytest.raises(UserError, match="not a plain description"):
        canonical({"a": odd})


def test_a_method_is_the_same_after_a_change_of_its_words(tmp_path: Path) -> None:
    assert code(tmp_path) == code(tmp_path, doc="Other words.", comment="because")


def test_a_method_is_another_after_a_change_of_its_code(tmp_path: Path) -> None:
    assert code(tmp_path) != code(tmp_path, value="2")


def names(cls: type[Any], folder: Path) -> set[str]:
    """The files that a class's code is in, seen from a folder."""
    return {str(file.relative_to(folder)) for file in code_of(cls)}


def test_a_method_is_another_after_a_change_of_a_module_beside_it() -> None:
    from holobench_eval.methods import wirtinger

    folder = Path(wirtinger.__file__).parent
    assert {"losses.py", "common.py"} <= names(wirtinger.Wirtinger, folder)


def test_a_method_in_a_folder_of_its_own_depends_on_methods_beside_the_folder_and_on_nothing_outside() -> None:
    from holobench_eval.methods import wirtinger
    from holobench_eval.methods.hil import hil

    found = names(hil.HIL, Path(wirtinger.__file__).parent)
    assert {"hil/hil.py", "hil/networks.py", "wirtinger.py", "losses.py", "common.py"} <= found
    assert not any(name.startswith("..") or "display" in Path(name).parts for name in found)


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
