"""A bench with its camera registered, and the metered handle that a method gets of it."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, Literal, Protocol

import cv2
import numpy as np
import torch
from torch import Tensor

from ..core.device import CPU
from ..core.errors import BudgetError, CellError
from ..core.seeds import generator
from ..imaging.grid import fiducial
from ..imaging.register import Registration, register
from ..methods.wirtinger import Wirtinger
from ..optics.phase import TAU
from .api import Capture, DisplaySpec
from .simulated.pipeline import BenchSession, SimulatedBench
from .simulated.profile import Profile
from .simulated.stages.relay import sample, sampling_grid

Exposure = Literal["equal", "matched"]
FIDUCIAL_HOLOGRAMS, FIDUCIAL_STEPS = 4, 4
DARKEST_MEAN = 0.01
"""A target channel darker than this is exposed as if it had this mean, so that exposure stays finite."""


def white_irradiance(target: Tensor, spec: DisplaySpec) -> Tensor:
    """Light at a white pixel, per channel, if all light of the panel went into the target; mean incident light is 1."""
    share = target.mean((-2, -1)).clamp_min(DARKEST_MEAN) * (target.shape[-2] * target.shape[-1])
    return spec.shape[0] * spec.shape[1] / share


@dataclass(frozen=True)
class RectifiedCapture:
    """A capture brought into the target's frame.

    image: ``(C, h, w)`` linear light; 1 is what a white pixel gets if all light of the panel went into the target;
    efficiency: light in the region over light on the panel, mean over channels; saturated: fraction of samples;
    residual: registration residual [region px, rms], worst channel; exposure: electrons per unit of light.
    """

    image: Tensor
    capture: Capture
    saturated: float
    efficiency: float
    residual: float
    exposure: tuple[float, ...]


@dataclass(frozen=True)
class Simulation:
    """What the registered camera would see without noise, differentiable: all that is fixed about a bench.

    grids: per channel, where each pixel of the region lies on the panel's image, as ``sample`` takes it.
    """

    bench: SimulatedBench
    grids: tuple[Tensor, ...]

    def image(self, phase: Tensor) -> Tensor:
        """Intensity ``(C, h, w)`` in the region for a phase ``(C, H, W)`` [rad]; incident light is 1."""
        samples = self.bench.image_samples
        images = [self.bench.integrated(phase[channel], channel) for channel in range(phase.shape[0])]
        return torch.stack([sample(image, grid, samples) for image, grid in zip(images, self.grids, strict=False)])


class Shows:
    """A display that gives methods their handles; all random numbers depend on its seed."""

    is_real: ClassVar[bool] = False

    def for_method(
        self: Source,
        method: object,
        label: str,
        target: Tensor,
        item: str,
        repeat: int,
        budget: int | None = None,
        learned: Mapping[str, Any] | None = None,
    ) -> MeteredDisplay:
        """The handle that ``method`` gets to solve ``target`` ``(C, h, w)`` with at most ``budget`` captures.

        learned: what the method's ``prepare`` returned.
        """
        return MeteredDisplay(self, label, target, (self.seed, item, repeat), method, budget, learned)


@dataclass(frozen=True)
class CalibratedBench(Shows):
    """A simulated bench and its calibration: one registration for all methods, made before any of them is shown.

    registered_as: a bench whose registration holds for this one too, since no camera has moved (None: its own).
    """

    bench: SimulatedBench
    seed: int
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
        return register(self._fiducial(target), grid, self.bench.profile.residual_bound)

    @cached_property
    def simulation(self) -> Simulation:
        """The bench as the registered camera sees it, without noise."""
        points = self.bench.points.numpy()
        grids = []
        for warp in self.registration.warps:
            x, y = warp.coordinates()
            seen = cv2.remap(points, x.astype(np.float32), y.astype(np.float32), cv2.INTER_LINEAR)
            grids.append(sampling_grid(torch.from_numpy(seen), self.spec.shape).to(self.bench.device))
        return Simulation(self.bench, tuple(grids))

    def _fiducial(self, target: Tensor) -> Tensor:
        """Mean capture ``(C, Hs, Ws)`` of the holograms of the grid."""
        light = self.exposure(target)
        names = itertools.product(range(FIDUCIAL_HOLOGRAMS), range(FIDUCIAL_STEPS))
        captures = (
            self.bench.session(self.seed, "fiducial", *name, exposure=light).capture(phase)
            for name, phase in zip(names, fiducial_phases(self, target), strict=True)
        )
        return sum((capture.linear() for capture in captures), torch.zeros(())) / (FIDUCIAL_HOLOGRAMS * FIDUCIAL_STEPS)

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
        """Show ``phase`` ``(C, H, W)`` [rad] and bring its capture into the frame of ``target`` ``(C, h, w)``.

        Exposure "equal": the same light for every method; "matched": a metering capture first, then the laser power
        that gives the region the target's mean brightness (paper section 7 does so for double-phase holograms).
        """
        check_phase(phase, self.spec, label)
        light = self.exposure(target)
        session = self.bench.session(self.seed, item, repeat, "score", exposure=light)
        if exposure == "matched":
            metered = self.rectified(session.capture(phase), target)
            ratio = target.mean((-2, -1)) / metered.mean((-2, -1)).clamp_min(1e-3)
            light = tuple((torch.tensor(light) * ratio).tolist())
            session = self.bench.session(self.seed, item, repeat, "score", exposure=light)
        capture = session.capture(phase)
        image = self.rectified(capture, target)
        share = image.mean((-2, -1)) / target.mean((-2, -1)).clamp_min(DARKEST_MEAN)
        return RectifiedCapture(
            image=image,
            capture=capture,
            saturated=capture.saturated,
            efficiency=float(share.mean()),
            residual=max(self.registration.residual),
            exposure=light,
        )

    def rectified(self, capture: Capture, target: Tensor) -> Tensor:
        """A capture as ``(C, h, w)`` in the frame of the target, on its device, in the unit of ``RectifiedCapture``."""
        light = self.registration.rectify(capture.linear()).to(target.device)
        return light / white_irradiance(target, self.spec)[: light.shape[0], None, None]


class Session(Protocol):
    """A camera that counts its frames."""

    def announce(self, phases: Sequence[Tensor]) -> None:
        """Tell which phases ``(C, H, W)`` [rad] are captured next, so that they can be captured in one go."""
        ...

    def capture(self, phase: Tensor) -> Capture:
        """Show ``phase`` ``(C, H, W)`` [rad] and photograph the image plane."""
        ...


class Source(Protocol):
    """What is behind the handle of a method: a simulated bench, a real one or a learned display."""

    @property
    def seed(self) -> int:
        """What all random numbers of the display depend on."""
        ...

    @property
    def spec(self) -> DisplaySpec:
        """Nominal optics."""
        ...

    @property
    def simulation(self) -> Simulation:
        """The bench itself. CellError where there is none."""
        ...

    def session(self, names: tuple[object, ...], target: Tensor) -> Session:
        """The camera, under noise that depends on ``names``."""
        ...

    def rectified(self, capture: Capture, target: Tensor) -> Tensor:
        """A capture in the target's frame."""
        ...


class MeteredDisplay:
    """All that a method may see of a display: nominal optics, a metered camera, what it learned, named random numbers.

    Everything else is private to the harness, its account of captures included. method: who gets the handle, which
    decides on camera and privilege; budget: captures that may be taken, None for no limit; learned: what the method's
    ``prepare`` returned.
    """

    def __init__(
        self,
        workbench: Source,
        label: str,
        target: Tensor,
        names: tuple[object, ...],
        method: object = None,
        budget: int | None = None,
        learned: Mapping[str, Any] | None = None,
    ) -> None:
        self._workbench = workbench
        self._label = label
        self._target = target.clone()  # a method that writes to its target must not reach the scored one
        self._names = names
        self._camera = bool(getattr(method, "camera", False))
        self._privileged = bool(getattr(method, "privileged", False))
        self._budget = budget
        self._learned = learned
        self._captures = 0
        self._kept: Tensor | None = None
        self._over = ""

    @property
    def spec(self) -> DisplaySpec:
        """Nominal optics, public."""
        return self._workbench.spec

    @property
    def device(self) -> torch.device:
        """Where the target is, and with it all that a method computes."""
        return self._target.device

    @property
    def captures(self) -> int:
        """Captures taken so far."""
        return self._captures

    @property
    def budget(self) -> int | None:
        """Captures that the display allows in all, None for no limit; a method can plan its schedule for it."""
        return self._budget

    @property
    def kept(self) -> Tensor | None:
        """The best hologram so far, ``(C, H, W)`` [rad]: what the display scores if the budget ends. See ``keep``."""
        return self._kept

    @property
    def over(self) -> str:
        """Why the display refused a capture, empty if it refused none."""
        return self._over

    @property
    def learned(self) -> Mapping[str, Any]:
        """What the method's ``prepare`` returned. CellError for a method that declares no training."""
        if self._learned is None:
            raise CellError(f"{self._label} was not trained; a method that learns declares trains = True")
        return self._learned

    @property
    def light(self) -> Tensor:
        """Light at a white pixel, ``(C,)``, if all of the panel's went into the target; incident light is 1."""
        return white_irradiance(self._target, self.spec)

    @property
    def simulation(self) -> Simulation:
        """The bench itself, for privileged methods alone."""
        if not self._privileged:
            raise CellError(f"{self._label}: only a method that declares privileged = True may see the simulated bench")
        return self._workbench.simulation

    def generator(self, *names: object) -> torch.Generator:
        """Random numbers that depend on study seed, target, repeat and ``names``."""
        return generator("method", *self._names, *names)

    @cached_property
    def _session(self) -> Session:
        return self._workbench.session((*self._names, "solve"), self._target)

    def capture(self, phase: Tensor) -> Capture:
        """Show ``phase`` ``(C, H, W)`` [rad] and photograph it; counted. CellError if the method declares no camera."""
        if not self._camera:
            raise CellError(f"{self._label} took a capture, but declares no camera (camera = True)")
        if self._budget is not None and self._captures >= self._budget:
            self._over = f"{self._label} has used its {self._budget} captures"
            raise BudgetError(self._over)
        check_phase(phase, self.spec, self._label)
        self._captures += 1
        return self._session.capture(phase)

    def announce(self, phases: Sequence[Tensor]) -> None:
        """Tell the display which phases ``(C, H, W)`` [rad] are captured next, in that order, whatever they show.

        A bench whose photographs are taken elsewhere then asks for all of them at once; others need no notice.
        """
        left = len(phases) if self._budget is None else max(0, self._budget - self._captures)
        if self._camera:
            self._session.announce(phases[:left])

    def keep(self, phase: Tensor) -> None:
        """Hand in the best hologram so far, ``(C, H, W)`` or ``(1, C, H, W)`` [rad], in the place of an earlier one.

        It is scored if ``capture`` then ends the solution with a BudgetError. A copy is kept; CellError for a phase
        that no display can show.
        """
        one = phase[0] if phase.ndim == 4 and len(phase) == 1 else phase
        check_phase(one, self.spec, self._label)
        self._kept = one.detach().cpu().clone()

    def rectify(self, capture: Capture) -> Tensor:
        """A capture in the target's frame, ``(C, h, w)`` linear light; 1 is a white pixel at full efficiency."""
        return self._workbench.rectified(capture, self._target)


def fiducial_phases(display: Source, target: Tensor) -> list[Tensor]:
    """Phases ``(C, H, W)`` [rad] of the holograms of the grid ``target`` ``(C, h, w)`` that register a camera.

    They start at random, because a smoothly curved image phase turns a little defocus into a change of scale, and each
    is shown with several constant phases added, because unmodulated light interferes with the image and the mean over
    the steps cancels that; both then also average speckle.
    """
    phases = []
    for hologram in range(FIDUCIAL_HOLOGRAMS):
        handle = MeteredDisplay(display, "fiducial", target, (display.seed, "fiducial", hologram))
        phase = Wirtinger(iterations=30, initial_phase="random").solve(target[None], handle)[0]
        phases += [phase + step * TAU / FIDUCIAL_STEPS for step in range(FIDUCIAL_STEPS)]
    return phases


def check_phase(phase: Tensor, spec: DisplaySpec, label: str) -> None:
    """Refuse what no display can show; the error names the method."""
    who = f"{label}: " if label else ""
    if phase.ndim != 3 or tuple(phase.shape[-2:]) != spec.shape:
        raise CellError(
            f"{who}phase is {tuple(phase.shape)}, the display shows (channels, {spec.shape[0]}, {spec.shape[1]})"
        )
    if phase.is_complex() or not phase.is_floating_point():
        raise CellError(f"{who}phase is {phase.dtype}, the display shows real numbers in radians")
    bad = int((~torch.isfinite(phase)).sum())
    if bad:
        raise CellError(f"{who}phase holds {bad} values that are NaN or infinite; the display refuses it")


def open_bench(
    profile: Profile,
    panel: tuple[int, int] | None = None,
    seed: int = 0,
    registered_as: CalibratedBench | None = None,
    device: torch.device = CPU,
) -> CalibratedBench:
    """The simulated bench of a profile on a panel of (rows, columns) pixels; ``seed`` names its noise.

    registered_as: see ``CalibratedBench``; device: see ``SimulatedBench``.
    """
    return CalibratedBench(SimulatedBench(profile.scaled(panel), device), seed, registered_as)
