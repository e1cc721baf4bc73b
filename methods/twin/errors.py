"""How well captures determine what a twin says of its display: fits to halves of them, and what no capture shows.

Errors from noise alone are far too small, since what the model lacks decides. The halves hold holograms of different
kinds, which what it lacks pulls apart; what pulls both the same way is not seen so, and no error is stated below what
was left on simulated displays of known truth.
"""

from __future__ import annotations

import cmath
import copy
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import torch
from torch import Tensor, nn

from ...display.api import DisplaySpec
from ...display.estimates import QUANTITIES, Estimate
from ...optics.phase import TAU
from ..calibrated.approximator import PredictedCapture
from ..calibrated.diagnosis import diagnose, haze, is_blocked
from ..calibrated.display_model import KNOTS
from ..learned.samples import Sample
from .drift import taken
from .model import TwinCamera, TwinModel

QUANTILE = 2.35  # of Student's t, 90 % of which lie within: a spread over three colours
FAINTEST = 0.01  # of what a fit leaves of a capture: a smaller change is not seen
# Of the usual error of a quantity, what misfit left of 90 % of it on leto-2020, leto-aged, leto-dusty, plm-4bit and the
# three displays of tests/support/benches/outside.py, at 144 px; of quantities that are not named, a third or less.
LEFT = {
    **{"lut_exponent": 1.5, "crosstalk": 1.5, "light": 1.6, "undiffracted_fraction": 0.6, "undiffracted_phase": 1.4},
    "stray_reach": 0.5,
}
MISFIT = 1 / 3
LOOKED_AT = 6  # captures, or a few more, of all kinds


def estimates(learned: Mapping[str, Any], spec: DisplaySpec) -> list[Estimate]:
    """What a twin says of its display, with the errors; infinite for what no capture shows."""
    whole, *halves = (_quantities(state, spec) for state in (learned, *learned["halves"]))
    errors = {name: math.inf if name in learned["unseen"] else _spread(name, *halves) for name in names(whole)}
    return [replace(item, error=errors[item.name]) for item in whole]


def names(items: Iterable[Estimate]) -> list[str]:
    """Of quantities, each once."""
    return list(dict.fromkeys(item.name for item in items))


@torch.no_grad()
def _quantities(state: Mapping[str, Any], spec: DisplaySpec) -> list[Estimate]:
    model, camera = TwinModel(spec), TwinCamera(spec)
    model.load_state_dict(dict(state["model"]))
    camera.load_state_dict(dict(state["terms"]))
    counted = (camera.shaded().mean((-2, -1)) * camera.gain.exp()).tolist()  # of the light, by colour
    found = [*diagnose(model), *haze(state["terms"])]
    return [
        replace(item, value=item.value * counted[item.colour])
        if item.name == "light" and item.colour is not None
        else item
        for item in found
    ]


def _spread(name: str, first: Sequence[Estimate], second: Sequence[Estimate]) -> float:
    """Error of a fit to all captures, of which each half has half: its standard deviation times the quantile, and at
    least that of misfit."""
    values = [{item.colour: item.value for item in half if item.name == name} for half in (first, second)]
    apart = [values[0][colour] - values[1][colour] for colour in values[0].keys() & values[1].keys()]
    if QUANTITIES[name].unit == "rad":
        apart = [math.remainder(each, TAU) for each in apart]
    if not apart:
        return math.inf
    spread = QUANTILE * math.sqrt(sum(each**2 for each in apart) / len(apart)) / 2
    return max(spread, LEFT.get(name, MISFIT) * QUANTITIES[name].error)


@torch.no_grad()
def unseen(model: TwinModel, camera: TwinCamera, samples: Sequence[Sample]) -> list[str]:
    """Quantities of which a change by their usual error changes captures by next to nothing; and unmodulated light that
    the blaze moves away from the iris, of which the edges of the panel alone tell."""
    found = [name for name in NUDGES if is_blocked(model.spec) and name.startswith("undiffracted")]
    looked_at = samples[:: max(1, len(samples) // LOOKED_AT)]
    before = [_shown(model, camera, sample) for sample in looked_at]
    left = sum(float((image - sample.capture).square().mean()) for image, sample in zip(before, looked_at, strict=True))
    for name, nudge in NUDGES.items():
        pair = copy.deepcopy(model), copy.deepcopy(camera)
        nudge(*pair, QUANTITIES[name].error)
        changed = sum(
            float((_shown(*pair, sample) - image).square().mean())
            for image, sample in zip(before, looked_at, strict=True)
        )
        if changed < FAINTEST**2 * left:
            found.append(name)
    return list(dict.fromkeys(found))


def _shown(model: TwinModel, camera: TwinCamera, sample: Sample) -> Tensor:
    with taken(camera, sample):
        shown: Tensor = PredictedCapture(model, None, camera)(sample.phase, sample.light)
        return shown


Nudge = Callable[[TwinModel, TwinCamera, float], None]  # changes a twin by an amount of a quantity, in all colours


def _exponent(model: TwinModel, camera: TwinCamera, amount: float) -> None:
    level = torch.linspace(0, 1, KNOTS, device=model.table.device)
    model.table.add_(TAU * (level ** (1 + amount) - level))


def _undiffracted(model: TwinModel, camera: TwinCamera, amount: float) -> None:
    ratios = torch.view_as_complex(model.undiffracted)
    share = ratios.abs().square() / (1 + ratios.abs().square()) + amount
    model.undiffracted.copy_(torch.view_as_real(torch.polar((share / (1 - share)).sqrt(), ratios.angle())))


def _undiffracted_phase(model: TwinModel, camera: TwinCamera, amount: float) -> None:
    model.undiffracted.copy_(torch.view_as_real(torch.view_as_complex(model.undiffracted) * cmath.exp(1j * amount)))


def _log(module: nn.Module, parameter: str, amount: float) -> None:
    values: Tensor = getattr(module, parameter)
    values.copy_((values.exp() + amount).log())


def _stray(model: TwinModel, camera: TwinCamera, amount: float) -> None:
    camera.share.copy_((camera.share.sigmoid() + amount).clamp(max=0.99).logit())


def _aberration(mode: int) -> Nudge:
    def nudge(model: TwinModel, camera: TwinCamera, amount: float) -> None:
        model.aberration[:, mode] += TAU * amount

    return nudge


NUDGES: Mapping[str, Nudge] = {
    "lut_exponent": _exponent,
    "phase_gain": lambda model, camera, amount: _log(model, "gain", amount),
    "crosstalk": lambda model, camera, amount: _log(model, "crosstalk", amount),
    "undiffracted_fraction": _undiffracted,
    "undiffracted_phase": _undiffracted_phase,
    "light": lambda model, camera, amount: _log(model, "brightness", amount),
    "stray_share": _stray,
    "stray_reach": lambda model, camera, amount: _log(camera, "reach", amount),
    **{name: _aberration(mode) for mode, name in enumerate(TwinModel.MODES)},
}
