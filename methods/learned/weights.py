"""First weights of a network, and weights and optimiser states that come back from a file."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TypeVar

import torch
from torch import Tensor, nn

from ...core import seeds
from ...core.errors import UserError

Module = TypeVar("Module", bound=nn.Module)


@contextmanager
def seeded(*names: object) -> Iterator[None]:
    """Torch's random numbers of the CPU decided by names, and left as they were."""
    with torch.random.fork_rng(devices=[]):
        torch.set_rng_state(seeds.generator(*names).get_state())
        yield


def draw_weights(module: Module, deviation: float | None) -> Module:
    """The module with fresh normal weights and zero offsets, laid out channels last, which a CPU convolves faster.

    deviation: of the weights; None takes sqrt(2 / inputs of a neuron), as U-Net's publication does.
    """
    for layer in module.modules():
        if isinstance(layer, nn.Conv2d | nn.ConvTranspose2d):
            taps = math.prod(layer.kernel_size)
            if isinstance(layer, nn.ConvTranspose2d):
                taps //= math.prod(layer.stride)  # the zeros between the pixels are no inputs
            nn.init.normal_(layer.weight, std=deviation or math.sqrt(2 / (layer.in_channels * taps)))
            if layer.bias is not None:
                nn.init.zeros_(layer.bias)
    return module.to(memory_format=torch.channels_last)  # type: ignore[call-overload]


def start_at_zero(network: Module) -> Module:
    """A network whose last convolution gives zero: what it adds to is learned first, and it learns what that leaves."""
    last = [layer for layer in network.modules() if isinstance(layer, nn.Conv2d | nn.ConvTranspose2d)][-1]
    nn.init.zeros_(last.weight)
    if last.bias is not None:
        nn.init.zeros_(last.bias)
    return network


@contextmanager
def refuse_other_weights() -> Iterator[None]:
    """UserError, in one line, where weights that are loaded inside are those of another network."""
    try:
        yield
    except (KeyError, TypeError, AttributeError, RuntimeError) as error:
        reason = " ".join(str(error).split())[:160]
        raise UserError(f"these are not the weights of this network ({reason}); train it anew") from error


def load_moments(optimiser: torch.optim.Adam, state: dict[int, dict[str, Tensor]]) -> None:
    """Copies of Adam's moments in the layout of the parameters, which the fused step takes for granted, as it does the
    number of steps on their device.

    Raises ValueError where a shape is not the parameter's.
    """
    optimiser.load_state_dict({"state": state, "param_groups": optimiser.state_dict()["param_groups"]})
    for parameter, values in optimiser.state.items():
        device = parameter.device if optimiser.defaults["fused"] else "cpu"
        values["step"] = torch.tensor(float(values["step"]), device=device)
        for moment in ("exp_avg", "exp_avg_sq"):
            if values[moment].shape != parameter.shape:
                raise ValueError(f"{moment} {tuple(values[moment].shape)} for a parameter {tuple(parameter.shape)}")
            values[moment] = torch.empty_like(parameter).copy_(values[moment])
