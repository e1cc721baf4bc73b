"""A simulated bench with its camera registered."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, partial

import torch
from torch import Tensor

from ..imaging.grid import fiducial
from ..imaging.register import Registration, register
from .api import (
    Capture,
    DisplaySpec,
    Exposure,
    Fiducials,
    RectifiedCapture,
    efficiency,
    in_target_frame,
    white_irradiance,
)
from .metered import MethodHandles
from .phases import check_phase
from .resampling import Resampling
from .simulated.pipeline import BenchSession, SimulatedBench
from .simulated.stages.relay import sample


@dataclass(frozen=True)
class RegisteredSimulation:
    """What the registered camera would see without noise, differentiable: all that is fixed about a bench.

    Parameters
    ----------
    bench
        The bench.
    resamplings
        Per channel, how frames of the sensor are rectified.
    response
        Of the sensor's pixels, on the device of the bench.
    """

    bench: SimulatedBench
    resamplings: tuple[Resampling, ...]
    response: Tensor

    @property
    def gains(self) -> tuple[float, ...]:
        """See ``Simulation``: the two points of Gauss-Hermite quadrature over flicker, or 1 without it."""
        rms = self.bench.profile.flicker.rms
        return (1 - rms, 1 + rms) if rms else (1.0,)

    def expected(self, phase: Tensor, target: Tensor, gain: float = 1.0) -> tuple[Tensor, Tensor]:
        """See ``Simulation``; the capture is exposed for the target alone."""
        bench, white, seen = self.bench, white_irradiance(target, self.bench.spec), []
        for channel, resampling in enumerate(self.resamplings[: len(phase)]):
            light = sample(bench.integrated(phase[channel], channel, gain), bench.fine_grid, 1) / white[channel]
            mean, variance = bench.profile.sensor.expected(light, self.response, channel)
            seen.append((resampling(mean), resampling.noise_gain * resampling(variance)))
        means, variances = zip(*seen, strict=True)
        return torch.stack(means), torch.stack(variances)


@dataclass(frozen=True)
class CalibratedBench(MethodHandles):
    """A simulated bench and its calibration: one registration for all methods, made before any of them is shown.

    Parameters
    ----------
    bench
        The bench.
    seed
        Of the study; it names the noise.
    fiducials
        The holograms that the camera is registered with.
    registered_as
        A bench whose registration holds for this one too, since no camera has moved (None: its own).
    """

    bench: SimulatedBench
    seed: int
    fiducials: Fiducials
    registered_as: CalibratedBench | None = None

    @property
    def spec(self) -> DisplaySpec:
        """Nominal optics."""
        return self.bench.spec

    @cached_property
    def registration(self) -> Registration:
        """Camera geometry from circle-grid holograms (protocol, step 2). CellError when it cannot be trusted."""
        if self.registered_as is not None:
            return self.registered_as.registration
        grid = fiducial(self.spec.region.shape)
        target = grid.image.float().expand(len(self.spec.wavelengths), -1, -1).to(self.bench.device)
        light, holograms = self.exposure(target), self.fiducials(self, target)
        sessions = {name: self.bench.session(self.seed, "fiducial", *name, exposure=light) for name in holograms}
        captures = (sessions[name].capture(phase) for name, phase in holograms.items())
        mean = sum((capture.linear() for capture in captures), torch.zeros(())) / len(holograms)
        return register(mean, grid, self.bench.profile.residual_bound)

    @cached_property
    def simulation(self) -> RegisteredSimulation:
        """The bench as the registered camera sees it, without noise."""
        device = self.bench.device
        coordinates = (warp.coordinates() for warp in self.registration.warps)
        resamplings = tuple(Resampling(*(torch.from_numpy(at).to(device) for at in pair)) for pair in coordinates)
        return RegisteredSimulation(self.bench, resamplings, self.bench.response.to(device))

    def exposure(self, target: Tensor) -> tuple[float, ...]:
        """Electrons per unit of light and channel, from the target alone and so equal for every method.

        A white pixel that gets all the light it can fills the well to 1 / headroom.
        """
        sensor = self.bench.profile.sensor
        per_unit = sensor.full_well / sensor.headroom / white_irradiance(target, self.spec)
        return tuple(per_unit.tolist())

    def session(self, names: tuple[object, ...], target: Tensor) -> BenchSession:
        """The bench under noise that depends on ``names``, exposed for ``target``."""
        return self.bench.session(*names, exposure=self.exposure(target))

    def photograph(
        self, phase: Tensor, target: Tensor, item: str, repeat: int, exposure: Exposure = "equal", label: str = ""
    ) -> RectifiedCapture:
        """See ``Display.photograph``."""
        check_phase(phase, self.spec, label)
        light, session = self.exposure(target), partial(self.bench.session, self.seed, item, repeat, "score")
        if exposure == "matched":
            metered = self.rectified(session(exposure=light).capture(phase), target)
            ratio = target.mean((-2, -1)) / metered.mean((-2, -1)).clamp_min(1e-3)
            light = tuple((torch.tensor(light) * ratio).tolist())
        capture = session(exposure=light).capture(phase)
        image = self.rectified(capture, target)
        return RectifiedCapture(
            image=image,
            capture=capture,
            saturated=capture.saturated,
            efficiency=efficiency(image, target),
            residual=max(self.registration.residual),
            exposure=light,
        )

    def rectified(self, capture: Capture, target: Tensor) -> Tensor:
        """See ``Display.rectified``."""
        return in_target_frame(capture, target, self.spec, self.registration)
