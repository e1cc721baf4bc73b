"""Calibrate a bench profile on two published figures: double-phase encoding and Wirtinger holography, nothing else.

Free are the fraction of unmodulated light, within the range its sources give, and its phase against the modulated
light, which no source gives and which depends on the panel's voltages. Both methods feel the fraction; the phase
decides how much more the smooth images of double-phase encoding feel it. What other methods then score is a
prediction of the bench.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.optimize import least_squares
from torch import Tensor

from ..core import plugins
from ..display import CalibratedBench, Profile, load_profile
from ..display.simulated.pipeline import SimulatedBench
from ..display.simulated.stages import ZeroOrder
from ..metrics import match, score
from ..study.displays import open_bench

WANTED = {"double_phase": 15.24, "wirtinger": 17.6}
"""PSNR [dB] of hardware captures, paper Table 3."""

UNMODULATED_RANGE = (0.05, 0.35)
"""Fraction of incident power; up to 0.2 is usual, 0.35 has been reported off the design wavelength."""

PHASE_RANGE = (-math.pi, math.pi)
"""Phase of the unmodulated light [rad]."""


@dataclass(frozen=True)
class Calibration:
    """The two parameters found, and the mean PSNR (linear light) of a real capture of each method with them [dB]."""

    fraction: float
    phase: float
    psnr: dict[str, float]


def with_parameters(profile: Profile, fraction: float, phase: float) -> Profile:
    """The profile with other values of the two free parameters."""
    return replace(profile, zero_order=ZeroOrder(float(fraction), float(phase)))


def calibrate(profile: Profile, panel: tuple[int, int], seed: int) -> Calibration:
    """Fit the two parameters on the eight photographs of Table 3; a few minutes, mostly solving the holograms once."""
    spec = profile.spec(panel)
    photographs = plugins.build("datasets", "photographs", {})
    targets = {item: photographs.load(item, spec.region.shape) for item in photographs.items()}
    nominal = open_bench(profile, panel, seed)
    phases = {name: {item: _solve(name, nominal, target, item) for item, target in targets.items()} for name in WANTED}

    def error(parameters: NDArray[np.float64]) -> list[float]:
        bench = SimulatedBench(with_parameters(profile, *parameters).scaled(panel))
        found = [_mean([_quick(bench, shown[item], targets[item]) for item in targets]) for shown in phases.values()]
        print(f"unmodulated {parameters[0]:.3f} at {parameters[1]:+.2f} rad: ", end="")
        print(", ".join(f"{name} {value:.2f} dB" for name, value in zip(phases, found, strict=True)), flush=True)
        return [value - wanted for value, wanted in zip(found, WANTED.values(), strict=True)]

    low, high = zip(UNMODULATED_RANGE, PHASE_RANGE, strict=True)
    fit = least_squares(
        error, (0.2, -0.2), bounds=(low, high), diff_step=np.array([0.05, 0.3]), x_scale=(0.1, 1.0), max_nfev=10
    )
    fraction, phase = (round(float(value), 3) for value in fit.x)
    bench = open_bench(with_parameters(profile, fraction, phase), panel, seed)
    psnr = {
        name: _mean(
            [
                score(bench.photograph(shown[item], target, item, 0).image, target, metrics=("psnr",))["psnr_linear"]
                for item, target in targets.items()
            ]
        )
        for name, shown in phases.items()
    }
    return Calibration(fraction, phase, psnr)


@torch.no_grad()
def _quick(bench: SimulatedBench, phase: Tensor, target: Tensor) -> float:
    """PSNR [dB] without camera and registration, for the search."""
    image = match(bench.spec.region.crop(bench.image(phase)), target)[0]
    return float(-10 * torch.log10((image - target).square().mean()))


def _solve(name: str, bench: CalibratedBench, target: Tensor, item: str) -> Tensor:
    method = plugins.build("methods", name, {})
    phase: Tensor = method.solve(target[None], bench.for_method(method, name, target, item, 0))[0]
    return phase


def _mean(values: list[float]) -> float:
    return sum(values) / len(values)


def main(name: str, panel: tuple[int, int] = (256, 256), seed: int = 2020) -> None:
    """Print the fit for a profile, ready to be written into its file."""
    profile = load_profile(name)
    found = calibrate(profile, panel, seed)
    print(f"\n{profile.name} on {panel[0]} x {panel[1]} pixels, captured, registered and scored:")
    for method, wanted in WANTED.items():
        print(f"  {method:<14}{found.psnr[method]:6.2f} dB   wanted {wanted:.2f} (paper Table 3)")
    print("write into the profile, and raise its version if they differ:")
    print(f"  zero_order: {{fraction: {found.fraction}, phase: {found.phase}}}")
