"""Times of everything in ``cases``: ``holoeval bench``, or ``pytest tests/benchmarks --benchmark-enable``.

A plain test run calls each once, at an eighth of the size.
"""

import time

import pytest
from cases import CASES
from layout import Layout

MOST_ROUNDS, FEWEST_ROUNDS, SECONDS = 21, 3, 3.0


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_speed(benchmark, case):
    benchmark.group = case.group
    measured = benchmark.enabled
    try:
        work = (case if measured else case.shrunk()).work()
    except ModuleNotFoundError as error:
        pytest.skip(f"{error.name} is not installed")
    started = time.perf_counter()
    work.call()  # warms up, and tells how often there is time to repeat it
    seconds = time.perf_counter() - started
    rounds = round(min(MOST_ROUNDS, max(FEWEST_ROUNDS, SECONDS / seconds))) if seconds < SECONDS else 1
    benchmark.extra_info.update(group=case.group, version=case.version, **(work.facts() if measured else {}))
    layout = Layout(case.name)

    def elsewhere():
        layout.redraw()
        if seconds < SECONDS:  # the first call pays for the pages of new places; all versions are spared that alike
            work.call()

    benchmark.pedantic(work.call, setup=elsewhere, rounds=rounds if measured else 1)
