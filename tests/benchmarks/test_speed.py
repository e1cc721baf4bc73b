"""Everything that ``holoeval bench`` times runs: once, at an eighth of its size."""

import pytest
from cases import CASES


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_a_benchmark_runs(case):
    try:
        work = case.shrunk().work()
    except ModuleNotFoundError as error:
        pytest.skip(f"{error.name} is not installed")
    work.call()
