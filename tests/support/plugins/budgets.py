"""Methods that keep to their budget of captures, or do not."""

import torch

from holobench_eval.core.errors import BudgetError


def flat(target, bench):
    return torch.full((*target.shape[:2], *bench.spec.shape), 2.0)


def greedy(target, bench, keeps: bool = True):
    """Captures for ever; hands in its phase first, and other ones never."""
    phase = flat(target, bench)[0]
    if keeps:
        bench.keep(phase)
    while True:
        bench.capture(phase)
        phase.fill_(9.0)  # what was handed in is a copy


def modest(target, bench):
    """Takes as many captures as it may, and no more."""
    for _ in range(bench.budget or 1):
        bench.capture(flat(target, bench)[0])
    return flat(target, bench)


def deaf(target, bench):
    """Goes on after the display has ended it, and returns another phase than it has handed in."""
    phase = flat(target, bench)
    bench.keep(phase)
    try:
        while True:
            bench.capture(phase[0])
    except Exception:
        return phase.fill_(9.0)


def lying(target, bench):
    """Says of itself that the display has ended it."""
    bench.keep(flat(target, bench)[0])
    raise BudgetError("the best of all methods")


for method in (greedy, modest, deaf, lying):
    method.camera = True
