import platform
import random
import subprocess
import sys

import cv2
import numpy as np
import pytest
import torch

from holobench_eval.core.device import CPU, find, gpu_name, gpus, moved, repeatable
from holobench_eval.core.errors import UserError
from holobench_eval.display.simulated.stages.relay import gathered
from holobench_eval.imaging.shifts import mirrored
from holobench_eval.methods.calibrated.display_model import enlarged, weighted
from holobench_eval.methods.hil.generator import Dropout


@pytest.mark.skipif(torch.cuda.is_available(), reason="there is a CUDA device")
def test_without_a_gpu_everything_is_the_cpus_and_one_that_is_asked_for_is_refused() -> None:
    assert find("auto") == find("cpu") == CPU
    assert gpus("auto") == gpus("cpu") == 0
    assert gpu_name(CPU) == ""
    for name in ("cuda", "cuda:7"):
        with pytest.raises(UserError, match=f"--device {name}: torch .* finds no GPU"):
            find(name)


@pytest.mark.parametrize("name", ["", "gpu", "cuda:", "cuda:x", "cpu:0"])
def test_an_unknown_device_is_refused(name: str) -> None:
    with pytest.raises(UserError, match="unknown device"):
        find(name)


def test_a_number_beyond_the_last_gpu_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(torch.cuda, "is_available", lambda: True)
    monkeypatch.setattr(torch.cuda, "device_count", lambda: 2)
    assert find("auto") == find("cuda") == torch.device("cuda")
    assert find("cuda:1") == torch.device("cuda:1")
    assert (gpus("auto"), gpus("cuda:1"), gpus("cpu")) == (2, 1, 0)
    with pytest.raises(UserError, match="there are 2 GPUs"):
        find("cuda:2")


def test_what_is_there_already_is_given_back_as_it_is() -> None:
    state = {"weights": {"a": torch.ones(2)}, "list": [torch.ones(1), 3], "name": "x", "none": None}
    assert moved(state, CPU) is state
    there = moved(state, torch.device("meta"))
    assert there["weights"]["a"].device.type == there["list"][0].device.type == "meta"
    assert (there["list"][1], there["name"], there["none"]) == (3, "x", None)
    assert state["weights"]["a"].device == CPU


def slopes(function, image):
    image = image.clone().requires_grad_()
    draw = torch.Generator().manual_seed(2)
    value = function(image)
    (slope,) = torch.autograd.grad((value * torch.rand(value.shape, generator=draw)).sum(), image)
    return value.detach(), slope


def assert_same(one, other, image) -> None:
    for a, b in zip(slopes(one, image), slopes(other, image), strict=True):
        torch.testing.assert_close(a, b, rtol=1e-5, atol=1e-6)


def test_pixels_picked_by_index_are_those_of_grid_sample() -> None:
    draw = torch.Generator().manual_seed(1)
    grid = 2.4 * torch.rand(30, 40, 2, generator=draw) - 1.2  # some of it outside of the image

    def sampled(image):
        options = {"mode": "bilinear", "padding_mode": "zeros", "align_corners": True}
        return torch.nn.functional.grid_sample(image[None, None], grid[None], **options)[0, 0]

    assert_same(lambda image: gathered(image, grid), sampled, torch.rand(17, 23, generator=draw))


def test_mirrored_edges_put_together_are_those_of_torch(monkeypatch: pytest.MonkeyPatch) -> None:
    image = torch.rand(2, 3, 9, 11, generator=torch.Generator().manual_seed(1))
    expected = slopes(lambda image: mirrored(image, 4), image)
    monkeypatch.setattr(torch.Tensor, "is_cpu", False)
    for a, b in zip(slopes(lambda image: mirrored(image, 4), image), expected, strict=True):
        torch.testing.assert_close(a, b)


def test_products_with_matrices_interpolate_as_torch_does() -> None:
    grid = torch.randn(3, 24, 24, generator=torch.Generator().manual_seed(1))
    assert_same(lambda grid: weighted(grid, (96, 130)), lambda grid: enlarged(grid, (96, 130)), grid)


def test_dropout_draws_what_torchs_own_draws() -> None:
    features = torch.randn(1, 8, 6, 6).contiguous(memory_format=torch.channels_last)
    torch.manual_seed(3)
    expected = torch.nn.Dropout(0.5)(features)
    torch.manual_seed(3)
    assert torch.equal(Dropout(0.5)(features), expected)
    assert torch.equal(Dropout(0.5).eval()(features), features)


def test_a_worker_of_one_thread_filters_with_one_and_others_get_theirs_back() -> None:
    cv2.setNumThreads(2)
    with repeatable(1):
        assert (torch.get_num_threads(), cv2.getNumThreads()) == (1, 1)
    assert cv2.getNumThreads() == 2


def test_what_one_cell_left_behind_does_not_reach_the_random_numbers_of_the_next() -> None:
    drawn = []
    for left in (0, 1):
        random.seed(left)
        np.random.seed(left)  # noqa: NPY002
        torch.manual_seed(left)
        torch.set_default_device("meta" if left else None)
        with repeatable(1):
            drawn.append((random.random(), float(np.random.rand()), float(torch.rand(()))))  # noqa: NPY002
    assert drawn[0] == drawn[1]


STEPS = """
import ctypes, resource
import numpy as np
from holobench_eval.core.device import keep_freed_memory

def faults():
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    np.ones(2**26, np.uint8)
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before

keep_freed_memory()
faults()
print(faults())
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="another C library")
def test_an_array_that_is_freed_and_taken_again_costs_no_page_fault():
    """64 MiB: beyond 32 MiB, arrays come from the system each time unless glibc is told otherwise."""
    found = subprocess.run([sys.executable, "-c", STEPS], capture_output=True, text=True, check=True)
    assert int(found.stdout) < 100
