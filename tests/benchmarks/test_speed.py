"""Everything that ``holoeval bench`` times, one after the other by pytest-benchmark, for a record of one's own:
``pytest tests/benchmarks --benchmark-enable --benchmark-autosave``, and with ``--benchmark-compare`` the next time.

A plain test run calls each once, at an eighth of its size. What is compared with other versions takes turns instead, in
processes of its own: ``holoeval bench``.
"""

import pytest
from cases import CASES


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_speed(benchmark, case):
    try:
        work = (case if benchmark.enabled else case.shrunk()).work()
    except ModuleNotFoundError as error:
        pytest.skip(f"{error.name} is not installed")
    benchmark.group = case.group
    benchmark.pedantic(work.call, warmup_rounds=1 if benchmark.enabled else 0, rounds=7 if benchmark.enabled else 1)
