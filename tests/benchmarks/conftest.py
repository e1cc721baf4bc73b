import pytest
import torch


@pytest.fixture(autouse=True)
def two_threads(request):
    """Two threads where time is measured; a plain test run keeps its one."""
    before = torch.get_num_threads()
    torch.set_num_threads(2 if request.config.getoption("benchmark_enable") else before)
    yield
    torch.set_num_threads(before)


@pytest.fixture(scope="session")
def panel(request):
    """The panel of the paper where time is measured; a small one in a plain test run."""
    return (1080, 1920) if request.config.getoption("benchmark_enable") else (135, 240)
