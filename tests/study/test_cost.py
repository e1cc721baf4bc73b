from __future__ import annotations

import json
import subprocess
import sys
import weakref
from pathlib import Path

import numpy as np
import pytest

from holobench_eval.study import cost

ROOT = Path(__file__).parents[2]
LARGE = 48


def touched(mib: int) -> float:
    """Fill so many MiB and let go of them."""
    return float(np.ones(mib * 2**17).sum())


def peak_of_what_is_let_go() -> cost.Cost:
    watch = cost.start()
    touched(LARGE)
    return watch.stop()


def peak_beside_what_is_held() -> cost.Cost:
    held = np.ones(LARGE * 2**17)
    touched(LARGE)
    watch = cost.start()
    touched(4)
    taken = watch.stop()
    assert held.any()
    return taken


def peak_of_what_is_taken_again() -> cost.Cost:
    pieces = [np.ones(2**13) for _ in range(LARGE * 16)]  # small, so that the allocator keeps them
    del pieces
    watch = cost.start()
    pieces = [np.ones(2**13) for _ in range(LARGE * 16)]
    taken = watch.stop()
    assert len(pieces) == LARGE * 16
    return taken


PEAKS = (peak_of_what_is_let_go, peak_beside_what_is_held, peak_of_what_is_taken_again)


@pytest.mark.skipif(not Path("/proc/self/clear_refs").exists(), reason="memory is measured on Linux alone")
def test_the_peak_counts_without_earlier_ones_or_held_memory_and_with_what_is_taken_again() -> None:
    """In a process of its own: in one where the program break could once not be raised, as other tests may leave it,
    glibc no longer gives back what lies at the end of its memory."""
    code = f"import json; from {__name__} import PEAKS; print(json.dumps([vars(of()) for of in PEAKS]))"
    run = subprocess.run([sys.executable, "-c", code], cwd=ROOT, text=True, capture_output=True, check=True)
    found = json.loads(run.stdout)
    assert all(taken["seconds"] > 0 for taken in found)
    let_go, beside_held, again = (taken["memory_mib"] for taken in found)
    assert LARGE - 2 < let_go < LARGE + 16
    assert beside_held < LARGE / 2
    assert again > LARGE / 2


def test_without_the_linux_files_time_is_measured_and_memory_is_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cost, "PROCESS", tmp_path / "nowhere")
    taken = cost.start().stop()
    assert taken.memory_mib is None
    assert taken.seconds >= 0


class Node:
    """Something that can hold itself."""

    own: Node


def test_what_a_solution_left_in_circles_is_let_go_before_the_next() -> None:
    cost.start().stop()
    left = Node()
    left.own = left
    seen = weakref.ref(left)
    del left
    cost.start().stop()
    assert seen() is None
