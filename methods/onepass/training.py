"""Training a one-pass network, which may be killed and resumed at any moment."""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch import Tensor, nn

from ...display.training import TrainingBench
from ..descent import cosine_decay
from ..learned.weights import load_moments
from ..losses import amplitude_l2

STEPS_BETWEEN_SAVES = 100
LONGEST_GRADIENT = 0.1  # a U-Net straight to phase left its minimum for good after a few steep ones
KEPT = "one-pass network"


def train(
    network: nn.Module,
    phase: Callable[[Tensor], Tensor],
    show: Callable[[Tensor, Tensor], Tensor],
    bench: TrainingBench,
    steps: int,
    rate: float,
    number: int,
) -> None:
    """Adam on the weights of a network, in place, an image in one of its four mirrorings a step.

    phase: target ``(C, h, w)`` to phase ``(C, H, W)`` [rad] by the network. show: phase and the light of a white pixel
    ``(C,)`` to the expected picture ``(C, h, w)``. number: of the round in the log.
    """
    optimiser = torch.optim.Adam(network.parameters(), lr=rate)
    saved = bench.load(KEPT) or {"step": 0}
    if saved["step"]:
        network.load_state_dict(saved["network"])
        load_moments(optimiser, saved["optimiser"])
    draw, passes = bench.generator(KEPT), -(-steps // len(bench.images))
    order = torch.cat([torch.randperm(len(bench.images), generator=draw) for _ in range(passes)]).tolist()
    mirrored = (torch.rand(steps, 2, generator=draw) < 0.5).tolist()
    total = 0.0
    for step in range(saved["step"], steps):
        image = bench.images[order[step]]
        target = image.target.flip([axis for axis, flip in zip((-2, -1), mirrored[step], strict=True) if flip])
        loss = amplitude_l2(show(phase(target), bench.light(image)), target).mean()
        optimiser.param_groups[0]["lr"] = cosine_decay(rate, step / steps)
        optimiser.zero_grad()
        loss.backward()
        nn.utils.clip_grad_norm_(network.parameters(), LONGEST_GRADIENT)
        optimiser.step()
        total += float(loss.detach())
        done = step + 1
        if done % STEPS_BETWEEN_SAVES == 0 or done == steps:
            count = (step - saved["step"]) % STEPS_BETWEEN_SAVES + 1
            bench.log(round=number, step=done, share=round(done / steps, 4), loss=total / count)
            state = {"network": network.state_dict(), "optimiser": optimiser.state_dict()["state"]}
            bench.save(KEPT, {"step": done, **state})
            total = 0.0
