from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from holobench_eval.core.schema import Metres, metres


@pytest.mark.parametrize(
    ("low", "high", "given_", "says"),
    [
        (200e-9, 2000e-9, 532.0, "532 is not in 200e-9 to 2e-6 m; lengths are in metres: 532e-9"),
        (200e-9, 2000e-9, 0.532, "; lengths are in metres: 0.532e-6"),
        (0.5e-6, 200e-6, 8.0, "8 is not in 500e-9 to 200e-6 m; lengths are in metres: 8e-6"),
        (0.1e-3, 10.0, 100.0, "100 is not in 100e-6 to 10 m; lengths are in metres: 100e-3"),
        (0.1e-3, 10.0, 0.0, "0 is not in 100e-6 to 10 m"),
        (0.1e-3, 10.0, -3.0, "-3 is not in 100e-6 to 10 m"),
    ],
)
def test_a_length_in_another_unit_is_refused_with_its_value_in_metres(low, high, given_, says):
    fault = Metres(low, high).fault(given_)
    assert fault.endswith(says)
    assert ("; " in fault) == ("; " in says)


@given(st.floats(201e-9, 1999e-9), st.sampled_from([1e3, 1e6, 1e9]))
def test_the_remedy_is_in_the_range_and_what_was_meant(length, unit):
    assert Metres(200e-9, 2000e-9).fault(length) == ""
    remedy = Metres(200e-9, 2000e-9).fault(length * unit).rpartition(": ")[2]
    assert float(remedy) == pytest.approx(length, rel=1e-5)


@given(st.floats(1e-9, 100))
def test_a_length_reads_back_as_it_was_written(length):
    assert float(metres(length)) == pytest.approx(length, rel=1e-5)
