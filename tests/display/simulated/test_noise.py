"""Noise by counter: normal, independent everywhere, and the same whatever draws it."""

import numpy as np
import pytest
import torch

from holobench_eval.core import compiled
from holobench_eval.display import load_profile
from holobench_eval.display.simulated.kernels import philox
from holobench_eval.display.simulated.noise import normal
from holobench_eval.display.simulated.pipeline import SimulatedBench

FRAME = slice(0, 1000), 1003
COUNT = 1000 * 1003


def test_words_are_those_that_the_authors_of_philox_publish():
    zero = np.zeros(1, np.uint64)
    words = philox(zero, zero, (np.uint64(0), np.uint64(0)))  # Random123, kat_vectors: philox4x32 10, all zero
    assert [int(word[0]) for word in words] == [0x6627E8D5, 0xE169C58D, 0xBC57AC4C, 0x9B00DBD8]


def test_numbers_have_the_moments_and_the_tails_of_a_normal_distribution():
    z = normal(11, *FRAME).double()
    error = COUNT**-0.5
    assert abs(float(z.mean())) < 4 * error
    assert abs(float(z.square().mean()) - 1) < 4 * 2**0.5 * error
    assert abs(float(z.pow(3).mean())) < 4 * 15**0.5 * error
    assert abs(float(z.pow(4).mean()) - 3) < 4 * 96**0.5 * error
    for sigma, share in ((1, 0.317311), (2, 0.045500), (3, 0.0026998), (4, 6.334e-5)):
        wanted = share * COUNT
        assert abs(int((z.abs() > sigma).sum()) - wanted) < 4 * wanted**0.5 + 1


@pytest.mark.parametrize(
    "other", ["next key", "key of the other half", "next row", "next column", "next quarter", "square"]
)
def test_neighbours_are_not_correlated(other):
    z = normal(11, *FRAME)
    shifted = {
        "next key": lambda: normal(12, *FRAME),
        "key of the other half": lambda: normal(11 + (1 << 32), *FRAME),
        "next row": lambda: z.roll(1, 0),
        "next column": lambda: z.roll(1, 1),
        "next quarter": lambda: z.roll(251, 1),
        "square": lambda: z.roll(251, 1).square() - 1,  # numbers of a pair have no common radius
    }[other]()
    assert abs(float((z.double() * shifted).mean())) < 5 * COUNT**-0.5
    assert abs(float(((z.double().square() - 1) * shifted).mean())) < 8 * COUNT**-0.5


def test_numbers_do_not_depend_on_the_block_of_rows_that_they_are_drawn_in_or_on_numba(monkeypatch):
    parts = [normal(5, slice(first, first + 30), 77) for first in (0, 30, 60)]
    assert torch.equal(normal(5, slice(0, 90), 77), torch.cat(parts))
    fast = normal(2**63 - 9, slice(7, 60), 130)
    monkeypatch.setattr(compiled, "AVAILABLE", False)
    assert torch.allclose(fast, normal(2**63 - 9, slice(7, 60), 130), atol=2e-6)


def test_a_capture_is_the_same_for_any_number_of_threads_and_new_in_every_channel_and_frame():
    bench = SimulatedBench(load_profile("leto-aged").scaled((512, 704)))  # more than one block of the sensor
    phase, before = torch.zeros(3, 512, 704), torch.get_num_threads()
    frames = []
    for threads in (1, 3):
        torch.set_num_threads(threads)
        session = bench.session("test", exposure=(4000.0,) * 3)
        frames.append(torch.stack([session.capture(phase).frame for _ in range(2)]))
    torch.set_num_threads(before)
    assert torch.equal(*frames)
    noise = (frames[0] - frames[0].mean((-2, -1), keepdim=True)).flatten(0, 1).flatten(1)
    keys = {tuple(row[:50].tolist()) for row in noise}
    assert len(keys) == 6
