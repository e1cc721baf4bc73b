import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from holobench_eval.core.errors import UserError
from holobench_eval.core.hashing import canonical, digest

PLAIN = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3),
    max_leaves=8,
)


def test_a_digest_does_not_change_between_versions() -> None:
    assert digest({"b": [1, 2.5, "x"], "a": None}) == "cacedc786abc936ff5388c20aad7a580a43bd81efb4e8df98d138f3816b04bab"


@settings(max_examples=50)
@given(st.dictionaries(st.text(), PLAIN, max_size=5))
def test_a_digest_does_not_depend_on_the_order_of_keys(description: dict[str, object]) -> None:
    assert digest(dict(reversed(description.items()))) == digest(description)


@pytest.mark.parametrize("odd", [math.nan, math.inf, object(), b"bytes"])
def test_what_is_not_plain_has_no_digest(odd: object) -> None:
    with pytest.raises(UserError, match="not a plain description"):
        canonical({"a": odd})
