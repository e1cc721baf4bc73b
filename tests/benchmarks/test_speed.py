"""What is timed, by pytest-benchmark (docs/speed.md). A plain test run calls each once, at an eighth of its size."""

from operator import attrgetter

import pytest
import torch
from cases import CASES


@pytest.mark.parametrize("case", sorted(CASES, key=attrgetter("group")), ids=lambda case: case.name)
def test_speed(benchmark, case):
    torch.set_num_threads(case.threads if benchmark.enabled else torch.get_num_threads())
    try:
        work = (case if benchmark.enabled else case.shrunk()).work()
    except ModuleNotFoundError as error:
        pytest.skip(f"{error.name} is not installed")
    benchmark.group = case.group
    benchmark.pedantic(work.call, warmup_rounds=1 if benchmark.enabled else 0, rounds=7 if benchmark.enabled else 1)
    benchmark.extra_info.update(work.facts(), version=case.version)
