"""``holoeval calibrate``: fit a profile to two published figures, double-phase encoding and Wirtinger holography.

Free are the fraction of unmodulated light, within the range its sources give, and its phase against the modulated
light, which no source gives and which depends on the panel's voltages. Both methods feel the fraction; the phase
decides how much more the smooth images of double-phase encoding feel it. What other methods then score is a
prediction of the bench.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from statistics import fmean
from typing import TYPE_CHECKING

from .options import Profile as ProfileName

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray
    from torch import Tensor

    from ..display import CalibratedBench, Profile
    from ..display.simulated.pipeline import SimulatedBench

PUBLISHED = {"double_phase": 15.24, "wirtinger": 17.6}  # PSNR [dB] of hardware captures, paper Table 3
# Fraction of incident power: up to 0.2 is usual, 0.35 has been reported off the design wavelength.
UNMODULATED_RANGE = (0.05, 0.35)
PHASE_RANGE = (-math.pi, math.pi)  # of the unmodulated light [rad]
PANEL, SEED = (256, 256), 2020


def calibrate(profile: ProfileName) -> None:
    """Fit the free parameters of a profile to published figures; a few minutes."""
    from ..display import load_profile

    loaded = load_profile(profile)
    calibration = fit(loaded, PANEL, SEED)
    print(f"\n{loaded.name} on {PANEL[0]} x {PANEL[1]} pixels, captured, registered and scored:")
    for method, published in PUBLISHED.items():
        print(f"  {method:<14}{calibration.psnr[method]:6.2f} dB   wanted {published:.2f} (paper Table 3)")
    print("write into the profile, and raise its version if they differ:")
    print(f"  zero_order: {{fraction: {calibration.fraction}, phase: {calibration.phase}}}")


@dataclass(frozen=True)
class Calibration:
    """The two parameters found, and the mean PSNR (linear light) of a real capture of each method with them [dB]."""

    fraction: float
    phase: float
    psnr: dict[str, float]


def fit(profile: Profile, panel: tuple[int, int], seed: int) -> Calibration:
    """Fit the two parameters on the eight photographs of Table 3, mostly by solving their holograms once.

    panel: rows and columns in pixels; seed: of the display's random patterns and of the camera's noise.
    """
    import numpy as np
    from scipy.optimize import least_squares

    from ..core import plugins
    from ..display.simulated.pipeline import SimulatedBench
    from ..metrics import score
    from ..study.opening import open_bench

    spec = profile.spec(panel)
    photographs = plugins.build("datasets", "photographs", {})
    targets = {item: photographs.load(item, spec.region.shape) for item in photographs.items()}
    nominal = open_bench(profile, panel, seed)
    holograms = {
        name: {item: _solve(name, nominal, target, item) for item, target in targets.items()} for name in PUBLISHED
    }

    def error(parameters: NDArray[np.float64]) -> list[float]:
        bench = SimulatedBench(_with_parameters(profile, *parameters).scaled(panel))
        psnr = {
            name: fmean(_quick_psnr(bench, phase, targets[item]) for item, phase in phases.items())
            for name, phases in holograms.items()
        }
        print(f"unmodulated {parameters[0]:.3f} at {parameters[1]:+.2f} rad: ", end="")
        print(", ".join(f"{name} {value:.2f} dB" for name, value in psnr.items()), flush=True)
        return [psnr[name] - published for name, published in PUBLISHED.items()]

    low, high = zip(UNMODULATED_RANGE, PHASE_RANGE, strict=True)
    result = least_squares(
        error, (0.2, -0.2), bounds=(low, high), diff_step=np.array([0.05, 0.3]), x_scale=(0.1, 1.0), max_nfev=10
    )
    fraction, phase = (round(float(value), 3) for value in result.x)
    bench = open_bench(_with_parameters(profile, fraction, phase), panel, seed)

    def psnr(phase: Tensor, item: str) -> float:
        image = bench.photograph(phase, targets[item], item, 0).image
        return score(image, targets[item], metrics=("psnr",))["psnr_linear"]

    return Calibration(
        fraction,
        phase,
        {name: fmean(psnr(phase, item) for item, phase in phases.items()) for name, phases in holograms.items()},
    )


def _with_parameters(profile: Profile, fraction: float, phase: float) -> Profile:
    from ..display.simulated.stages import ZeroOrder

    return replace(profile, zero_order=ZeroOrder(float(fraction), float(phase)))


def _quick_psnr(bench: SimulatedBench, phase: Tensor, target: Tensor) -> float:
    """PSNR [dB] without camera and registration, for the search."""
    import torch

    from ..metrics import match

    with torch.no_grad():
        image = match(bench.spec.region.crop(bench.image(phase)), target)[0]
        return float(-10 * torch.log10((image - target).square().mean()))


def _solve(name: str, bench: CalibratedBench, target: Tensor, item: str) -> Tensor:
    from ..core import plugins

    method = plugins.build("methods", name, {})
    phase: Tensor = method.solve(target[None], bench.for_method(method, name, target, item, 0))[0]
    return phase
