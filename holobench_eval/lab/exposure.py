"""Exposure and what follows from it: frames averaged, dark frames subtracted, brackets combined. All in float."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..imaging.warp import Array
from .counts import step as step_of
from .dark import Dark
from .devices import Camera, Counts, DeviceError
from .photograph import MOST_SATURATED

FILL, PERCENTILE = 0.7, 99.9  # where auto exposure puts which samples, as a part of the range from dark to white
ACCEPTED = 0.6, 1.25  # of FILL: wide enough for shutters that know only full stops
DIMMEST = 0.1  # of the range; less is refused, since the counts are too coarse
TRIES = 16
STRONGEST_STEP = 32.0
ORDER = [0, 0, 1, 1, 1, 0, 0, 0]  # of two kinds of picture
LIT = 1.0  # seconds that show any picture
SHALLOWEST = 15  # counts of a picture that tell how deep they are
FEW = 0.01  # of the samples, which may be hot pixels where no more are at full scale


@dataclass(frozen=True, eq=False)
class Averaged:
    """The mean of some frames: counts ``(Hs, Ws)`` float64, which samples any of them saturates, seconds of each."""

    counts: Array
    saturated: NDArray[np.bool_]
    seconds: float


def averaged(camera: Camera, seconds: float, count: int, plane: int) -> Averaged:
    """Mean of ``count`` frames; plane: the one that is taken of a colour camera's. DeviceError for no good frame."""
    total: Array = np.zeros(())
    saturated: NDArray[np.bool_] = np.zeros((), dtype=bool)
    took = 0.0
    for _ in range(count):
        frame, real = exposed(camera, seconds, plane)
        if total.ndim and total.shape != frame.shape:
            raise DeviceError(f"{camera.name}: a frame of {frame.shape} follows one of {total.shape}")
        total, saturated, took = total + frame, saturated | (frame >= camera.white), took + real
    return Averaged(total / count, saturated, took / count)


def late(take: Callable[[int], Array]) -> int | None:
    """How many frames late a camera is, None where two kinds of picture look alike; take: the next frame, of a kind.

    The two kinds are taken in an order that no shift repeats.
    """
    frames = [take(kind) for kind in ORDER]
    if len(shapes := sorted({frame.shape for frame in frames})) > 1:
        raise DeviceError(f"frames differ in size: {shapes}")
    noise = float(np.median([_apart(*pair) for pair in pairwise(frames)]))
    first, other = frames[0], max(frames, key=lambda frame: _apart(frame, frames[0]))
    if not _apart(first, other) > 3 * noise:
        return None
    seen = [int(_apart(frame, other) < _apart(frame, first)) for frame in frames]
    return next(count for count in range(len(ORDER) + 1) if seen[count:] == ORDER[: len(ORDER) - count])


def _apart(one: Array, other: Array) -> float:
    return float(np.sqrt(np.mean((one - other) ** 2)))


def refuse_late(camera: Camera, plane: int) -> None:
    """DeviceError for a camera whose first frame after a change of the exposure is from before it, in steady light."""
    shortest, longest = camera.exposures
    for seconds in np.geomspace(shortest, max(min(longest, LIT), shortest), 4)[1:]:
        frames: list[Array] = []

        def take(kind: int, frames: list[Array] = frames, times: Sequence[float] = (shortest, seconds)) -> Array:
            frames.append(exposed(camera, times[kind], plane)[0].astype(np.float32))
            return frames[-1]

        count = late(take)
        if count:
            remedy = "empty its queue of frames before each, or trigger each"
            raise DeviceError(
                f"{camera.name}: frame {count + 1} after an exposure was set is the first with it; {remedy}"
            )
        if count == 0:
            return
        if not _dark(frames[0]) and all(np.array_equal(frames[0], frame) for frame in frames):
            raise DeviceError(
                f"{camera.name}: gives one and the same frame, byte for byte, at exposures of {shortest:.2g} and "
                f"{seconds:.2g} s; does it return the last frame again, or ignore its exposure?"
            )


def miscounted(frame: Counts, white: float) -> str:
    """What is wrong with a camera whose counts end below its white, "" where nothing is seen of that."""
    top, low = int(frame.max()), int(np.percentile(frame, 1))
    share, below = np.mean(frame == top), np.mean((frame < top) & (frame >= top - max(0.05 * (top - low), 1)))
    if not SHALLOWEST < top < white or _dark(frame) or share <= max(MOST_SATURATED, 2 * below):
        return ""
    shifted = f" (all are multiples of {unit})" if (unit := step_of(frame)) > 1 else ""
    return f"its counts end at {top}{shifted}, below its white of {white:g}; set its white to that, or its bits"


def exposed(camera: Camera, seconds: float, plane: int) -> tuple[Counts, float]:
    """One plane of a frame and its exposure [s], within its limits. DeviceError for no photograph."""
    shortest, longest = camera.exposures
    frame, real = camera.expose(min(max(seconds, shortest), longest))
    if frame.ndim == 3:
        frame = frame[..., plane]
    if frame.ndim != 2 or not frame.size or not np.isfinite(real) or real <= 0:
        raise DeviceError(
            f"{camera.name}: a frame of shape {frame.shape} that was exposed for {real} s is no photograph"
        )
    return frame, real


class FreshCamera:
    """A camera that refuses a second delivery of the last frame from before the panel or the laser changed.

    Some drivers repeat a frame, and an old one would be scored as the new picture. Noise alone makes any two frames of
    a sensor differ, but for dark ones. An old frame that was never delivered cannot be known by its bytes.
    """

    def __init__(self, camera: Camera) -> None:
        self.camera = camera
        self.name, self.white, self.exposures, self.close = camera.name, camera.white, camera.exposures, camera.close
        self._shown: object = None
        self._before: Counts | None = None
        self._latest: Counts | None = None

    def changed(self, shown: object) -> None:
        """The panel and the laser are about to show ``shown``, which may be what they showed before."""
        if shown != self._shown:
            self._shown, self._before = shown, self._latest

    def expose(self, seconds: float) -> tuple[Counts, float]:
        """As the camera's own; DeviceError for an old frame."""
        frame, real = self.camera.expose(seconds)
        if self._latest is not None and frame.shape != self._latest.shape:
            raise DeviceError(f"{self.name}: a frame of {frame.shape} follows one of {self._latest.shape}")
        self._latest = frame.copy()  # a driver may fill the same buffer again
        if self._before is not None and np.array_equal(frame, self._before) and not _dark(frame):
            raise DeviceError(f"{self.name}: gave the frame from before the panel changed")
        return frame, real


def _dark(frame: Counts | Array) -> bool:
    """Whether a frame is the same nearly everywhere; hot pixels are few."""
    low, high = np.percentile(frame, (1, 99))
    return bool(low == high)


def auto_exposure(camera: Camera, plane: int) -> float:
    """The exposure [s] at which the brightest samples of the present picture fill `FILL` of the camera's range.

    DeviceError, in one line, where no exposure of the camera does that.
    """
    shortest, longest = camera.exposures
    seconds = float(np.sqrt(shortest * longest))
    for _ in range(TRIES):
        frame, real = exposed(camera, seconds, plane)
        # dark level and background; where it is not dark at all, the steps are only less exact
        dark, bright = np.percentile(frame, (1, PERCENTILE))
        fill, full = float((bright - dark) / max(camera.white - dark, 1)), float(np.mean(frame >= camera.white))
        if fault := miscounted(frame, camera.white):
            raise DeviceError(f"{camera.name}: {fault}")
        if bright >= camera.white:
            step = 1 / STRONGEST_STEP if full > 0.1 else 0.25
        else:
            step = min(max(FILL / max(fill, 1e-6), 1 / STRONGEST_STEP), STRONGEST_STEP)
            if ACCEPTED[0] <= 1 / step <= ACCEPTED[1]:
                return real
        if step < 1 and seconds <= shortest:
            hot = f"; hot pixels, if the {full:.2%} at full scale are, its own software replaces" * (0 < full <= FEW)
            raise DeviceError(
                f"{camera.name}: too much light even at its shortest exposure of {shortest:.2g} s; "
                f"lower the laser's power or add a filter{hot}"
            )
        if step > 1 and seconds >= longest:
            if fill >= DIMMEST:
                return real
            raise DeviceError(
                f"{camera.name}: too little light at its longest exposure of {longest:.2g} s, {fill:.1%} of its range; "
                "is the laser on, the iris open, the lens cap off?"
            )
        seconds = min(max(real * step, shortest), longest)
    raise DeviceError(
        f"{camera.name}: no exposure is right after {TRIES} tries; is the light unsteady, or the exposure ignored?"
    )


def dark_frames(camera: Camera, count: int, seconds: tuple[float, float], plane: int) -> Dark:
    """Measure the dark counts, the light being off: means of ``count`` frames at a short and a long exposure.

    Two exposures, since dark current and stray light grow with time and photographs differ in it.
    """
    short, long = (averaged(camera, each, count, plane) for each in seconds)
    for each in (short, long):
        if np.mean(each.counts) > 0.25 * camera.white:
            raise DeviceError(f"{camera.name}: dark frames are bright; is the laser really off, the room dark?")
    if long.seconds < 1.5 * short.seconds:
        return Dark((short.counts + long.counts) / 2)
    rate = (long.counts - short.counts) / (long.seconds - short.seconds)
    return Dark(short.counts - rate * short.seconds, rate)


def combined(bracket: Sequence[Averaged], dark: Dark) -> tuple[Array, float]:
    """Light ``(Hs, Ws)`` [counts / s] of a bracket, and the fraction of samples that all of it saturates.

    Every unsaturated exposure counts with its time, which is best where shot noise prevails: all counts over all
    seconds. Samples without any get what the shortest exposure has, which is too little.
    """
    shortest = min(bracket, key=lambda each: each.seconds)
    counts, seconds = np.zeros_like(shortest.counts), np.zeros_like(shortest.counts)
    for each in bracket:
        good = ~each.saturated
        counts += np.where(good, dark.off(each.counts, each.seconds), 0.0)
        seconds += np.where(good, each.seconds, 0.0)
    lost = seconds == 0
    least = dark.off(shortest.counts, shortest.seconds) / shortest.seconds
    return np.where(lost, least, counts / np.where(lost, 1.0, seconds)), float(lost.mean())
