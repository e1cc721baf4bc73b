"""A method that photographs, and fails where its frames say so."""

import os

import torch


def mine(target, bench):
    phase = torch.rand((*target.shape[:2], *bench.spec.shape), generator=bench.generator("start"))
    for _ in range(3):
        capture = bench.capture(phase[0])
        if capture.frame.isnan().any():
            raise ValueError("a frame of nothing")
        if capture.frame.isinf().any():
            os.kill(os.getpid(), 9)
        phase = phase + bench.rectify(capture).mean()
    return phase


mine.camera = True
