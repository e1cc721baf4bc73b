"""A panel, its lasers and a camera around the simulated bench, on a clock of their own that nobody has to wait for."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from holobench_eval.display import CalibratedBench, load_profile
from holobench_eval.display.simulated.pipeline import SimulatedBench
from holobench_eval.display.simulated.stages.relay import sample
from holobench_eval.imaging.convention import Levels
from holobench_eval.lab.devices import Counts, DeviceError
from holobench_eval.lab.drivers import catalogue
from holobench_eval.lab.laser import SwitchedLaser
from holobench_eval.lab.test_pattern import draw_pattern
from holobench_eval.methods.fiducials import fiducial_phases
from holobench_eval.methods.initial_phase import InitialPhase
from holobench_eval.methods.wirtinger import Wirtinger

PANEL = (128, 128)
GREEN = 1


class Clock:
    """Time that passes when somebody waits."""

    def __init__(self) -> None:
        self.now = 0.0

    def wait(self, seconds: float) -> None:
        self.now += seconds


@lru_cache(maxsize=4)
def bench(profile: str = "leto-mild") -> SimulatedBench:
    return SimulatedBench(load_profile(profile).scaled(PANEL))


@lru_cache(maxsize=4)
def pattern_phase(profile: str = "leto-mild", initial_phase: InitialPhase = "random") -> Tensor:
    """Hologram ``(3, H, W)`` of the test pattern from nominal optics."""
    display = CalibratedBench(bench(profile), 0, fiducial_phases)
    target = draw_pattern(display.spec.region.shape).expand(3, -1, -1)
    handle = display.for_method(Wirtinger(), "wirtinger", target, "letter", 0)
    return Wirtinger(iterations=30, initial_phase=initial_phase).solve(target[None], handle)[0]


@dataclass
class Scene:
    """What light is on the sensor: the panel's picture, by the laser that is on.

    sign, two_pi_level: the panel's truth; mirrored: the relay mirrors left and right; flipped: the panel shows its
    columns in the other order; latency [s]: from showing to the first change; lag [s]: time constant of the liquid
    crystal, in light; restless: relative amplitude of the light's changes, of an unsteady laser.
    """

    bench: SimulatedBench
    clock: Clock = field(default_factory=Clock)
    sign: int = 1
    two_pi_level: float = 256.0
    mirrored: bool = False
    flipped: bool = False
    latency: float = 0.0
    lag: float = 0.0
    restless: float = 0.0
    channel: int | None = 0
    selected: list[int | None] = field(default_factory=list)
    history: list[tuple[float, Levels]] = field(default_factory=list)
    seen: dict[tuple[bytes, int], NDArray[np.float64]] = field(default_factory=dict)

    @property
    def shape(self) -> tuple[int, int]:
        rows, columns = self.bench.grid.shape[:2]
        return rows, columns

    def select(self, channel: int | None) -> None:
        self.channel = channel
        self.selected.append(channel)

    def close(self) -> None:
        self.select(None)

    def light(self) -> NDArray[np.float64]:
        if self.channel is None or not self.history:
            return np.zeros(self.shape)
        started, levels = self.history[-1]
        new, since = self.settled(levels), self.clock.now - started - self.latency
        old = self.settled(self.history[-2][1]) if len(self.history) > 1 else np.zeros_like(new)
        if since < 0:
            return old
        share = 1 - math.exp(-since / self.lag) if self.lag else 1.0
        light = old + (new - old) * share
        return light * (1 + self.restless * math.sin(40 * self.clock.now))

    def settled(self, levels: Levels) -> NDArray[np.float64]:
        assert self.channel is not None
        if levels.ndim == 3:
            return np.asarray(np.mean([self.settled(frame) for frame in levels], axis=0))
        key = (levels.tobytes(), self.channel)
        if key not in self.seen:
            picture = levels[:, ::-1] if self.flipped else levels
            phase = torch.from_numpy(self.sign * math.tau * picture.astype(np.float32) / self.two_pi_level)
            light = self.bench.integrated(phase, self.channel)
            light = sample(light, self.bench.grid, self.bench.image_samples).double().numpy()
            self.seen[key] = light[:, ::-1] if self.mirrored else light
        return self.seen[key]


@dataclass
class Still:
    """A picture that nothing changes, lit as long as a channel is on."""

    picture: NDArray[np.float64]
    clock: Clock = field(default_factory=Clock)
    channel: int | None = 0

    @property
    def shape(self) -> tuple[int, int]:
        rows, columns = self.picture.shape
        return rows, columns

    def light(self) -> NDArray[np.float64]:
        return self.picture if self.channel is not None else np.zeros_like(self.picture)


class SimulatedSlm:
    name = "simulated panel"

    def __init__(self, scene: Scene) -> None:
        self.scene, self.failures, self.shown = scene, 0, 0

    @property
    def shape(self) -> tuple[int, int]:
        return self.scene.bench.spec.shape

    def show(self, levels: Levels) -> None:
        if self.failures:
            self.failures -= 1
            raise DeviceError("simulated panel: not connected")
        assert levels.shape == self.shape
        assert levels.dtype == np.uint8
        self.shown += 1
        self.scene.history.append((self.scene.clock.now, levels.copy()))
        del self.scene.history[:-2]

    def close(self) -> None:
        pass


class FastSlm(SimulatedSlm):
    """A panel that turns through frames much faster than the camera exposes."""

    def show_sequence(self, frames: Sequence[Levels]) -> None:
        for frame in frames:
            self.show(frame)
        self.scene.history[-1] = (self.scene.clock.now, np.stack(frames))


@dataclass
class SimulatedCamera:
    """Counts of the scene: ``gain`` counts a second for the panel's mean light, on a dark level that grows with time.

    gamma: below 1 for a camera that encodes; noise [counts, rms]; colour: three planes, of which the laser lights
    one and leaks a tenth into the others; deaf: it never changes its exposure.
    """

    scene: Scene | Still
    gain: float = 20_000.0
    bits: int = 12
    dark: float = 64.0
    dark_rate: float = 0.0
    hot: float = 0.0
    gamma: float = 1.0
    noise: float = 0.0
    colour: bool = False
    deaf: bool = False
    exposures: tuple[float, float] = (1e-5, 10.0)
    failures: int = 0
    frames: int = 0
    name: str = "simulated camera"

    def __post_init__(self) -> None:
        self.random = np.random.default_rng(0)
        self.pattern = self.hot * self.random.random(self.scene.shape)

    @property
    def white(self) -> float:
        return 2.0**self.bits - 1

    def expose(self, seconds: float) -> tuple[Counts, float]:
        if self.failures:
            self.failures -= 1
            raise DeviceError("simulated camera: no frame within 1 s")
        self.frames += 1
        seconds = min(max(seconds, self.exposures[0]), self.exposures[1])
        counts = self._counts(self.scene.light(), 0.01 if self.deaf else seconds)
        self.scene.clock.wait(seconds)
        if not self.colour:
            return counts, seconds
        leak = self._counts(self.scene.light() / 10, seconds)
        planes = np.repeat(leak[..., None], 3, axis=-1)
        if self.scene.channel is not None:
            planes[..., self.scene.channel] = counts
        return planes, seconds

    def _counts(self, light: NDArray[np.float64], seconds: float) -> Counts:
        share = np.clip(light * self.gain * seconds / (self.white - self.dark), 0, None) ** self.gamma
        counts = share * (self.white - self.dark) + self.dark + self.dark_rate * seconds + self.pattern
        if self.noise:
            counts = counts + self.random.normal(0, self.noise, counts.shape)
        return np.clip(np.round(counts), 0, self.white).astype(np.uint16)

    def close(self) -> None:
        pass


BENCH = """\
name: small-table
version: 1
panel: {shape: [128, 128], pitch: 6.4e-6, wavelengths: [6.36e-7, 5.17e-7, 4.46e-7], distance: 0.0118518518, bits: 8, \
pupil: 0.8, region: 0.8}
slm: {driver: simulated}
camera: {driver: simulated}
capture: {average: 1, dark_frames: 1, settle: 0.0}
laser: {callable: "switch.py:switch"}
"""


@dataclass(frozen=True)
class Nothing:
    """No settings."""


def connect(slm: SimulatedSlm, camera: SimulatedCamera, put: Callable[[Any, str, Any], None] = setattr) -> None:
    """Put the devices behind the names that `BENCH` has. put: sets an attribute, such as pytest's for a test."""
    drivers = {}
    for kind, device in (("slm", slm), ("camera", camera)):
        known = next(iter(catalogue.DRIVERS[kind].values()))
        drivers[kind] = {"simulated": replace(known, settings=Nothing, opens=lambda _, device=device: device)}
    put(catalogue, "DRIVERS", drivers)
    put(SwitchedLaser, "select", lambda _, channel: slm.scene.select(channel))
