from __future__ import annotations

import math
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from holobench_eval import registry
from holobench_eval.errors import UserError
from holobench_eval.study.identity import canonical, code_digest, digest

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


def test_a_method_is_another_after_a_change_of_a_module_beside_it() -> None:
    from holobench_eval.methods import wirtinger
    from holobench_eval.study import identity

    files = identity._code(Path(wirtinger.__file__), 0)[1]
    assert {"losses.py", "common.py"} <= {file.name for file in files}
    assert all(file.parent == Path(wirtinger.__file__).parent for file in files)
