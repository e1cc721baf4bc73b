"""A method that takes two captures, and fails where a file says so."""

from pathlib import Path

import torch


def mine(target, bench):
    phase = torch.zeros(*target.shape[:2], *bench.spec.shape)
    for _ in range(2):
        bench.capture(phase[0])
    if Path(__file__).with_name("fail").exists():
        raise ValueError("no light")
    return phase


mine.camera = True
