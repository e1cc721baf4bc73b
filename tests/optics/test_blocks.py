"""Work in blocks, shared by threads."""

import multiprocessing

import pytest
import torch

from holobench_eval.optics import blocks, transfer
from holobench_eval.optics.angular_spectrum import AngularSpectrum
from holobench_eval.optics.blocks import in_blocks
from tests.support.patience import PATIENCE


@pytest.fixture(autouse=True)
def two_threads(monkeypatch):
    """The pool is used with several threads only; the other tests have one."""
    monkeypatch.setattr(blocks, "BLOCK_BYTES", 4096)
    monkeypatch.setattr(transfer, "LARGEST_KEPT", 0)
    torch.set_num_threads(2)
    yield
    torch.set_num_threads(1)


def filled():
    found = torch.zeros(100)

    def fill(lines):
        found[lines] += torch.arange(lines.start, lines.stop)

    in_blocks(fill, found, 100, 10_000)
    return found


def test_every_line_is_worked_on_once_and_a_failure_passes_through():
    assert torch.equal(filled(), torch.arange(100.0))

    def fail(lines):
        raise ArithmeticError

    with pytest.raises(ArithmeticError):
        in_blocks(fail, torch.zeros(100), 100, 10_000)
    assert torch.get_num_threads() == 2


def test_threads_give_the_numbers_of_one_thread():
    draw = torch.Generator().manual_seed(0)
    field = torch.randn(2, 70, 50, dtype=torch.complex128, generator=draw).requires_grad_()
    model = AngularSpectrum((70, 50), 6.4e-6, 532e-9, 6e-3, dtype=torch.complex128)
    found = []
    for threads in (2, 1):
        torch.set_num_threads(threads)
        field.grad = None
        image = model.forward(field)
        image.abs().square().sum().backward()
        found.append((image.detach(), field.grad))
    assert torch.equal(found[0][0], found[1][0])
    assert torch.equal(found[0][1], found[1][1])


def test_inference_mode_reaches_the_threads():
    model = AngularSpectrum((70, 50), 6.4e-6, 532e-9, 6e-3, dtype=torch.complex128)
    field = torch.ones(70, 50, dtype=torch.complex128)
    with torch.inference_mode():
        image = model.forward(field)
    assert torch.equal(image.clone(), model.forward(field))


def _work_in_the_child(answer):
    lines = []
    in_blocks(lines.append, torch.zeros(1), 100, 10_000)
    answer.put(sum(one.stop - one.start for one in lines))


@pytest.mark.skipif("fork" not in multiprocessing.get_all_start_methods(), reason="the system does not fork")
def test_a_forked_process_has_threads_of_its_own():
    filled()  # the parent's pool is there
    context = multiprocessing.get_context("fork")
    answer = context.Queue()
    child = context.Process(target=_work_in_the_child, args=(answer,))
    child.start()
    child.join(PATIENCE)
    hung = child.is_alive()
    child.kill()
    assert not hung
    assert answer.get(timeout=PATIENCE) == 100
