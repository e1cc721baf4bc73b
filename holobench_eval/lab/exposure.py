"""Exposure and what follows from it: frames averaged, dark frames subtracted, brackets combined. All in float."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..core.errors import LostDeviceError
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
ORDER = [0, 0, 1, 1, 1, 0, 0, 0, 0, 0, 0]  # of two kinds of picture
WAITING = 6  # frames that may be there from before
FAR = 8.0  # times an exposure: bright samples are saturated
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
        total, saturated, took = total + frame, saturated | (frame >= camera.white), took + real
    return Averaged(total / count, saturated, took / count)


def late(take: Callable[[int], Array]) -> tuple[int | None, list[Array]]:
    """How many frames late a camera is, None where two kinds of picture look alike; and the pictures, as in ``ORDER``.
    More than ``WAITING`` where that is not known.

    take: the next frame, of a kind. The two kinds are taken in an order that no shift repeats, after some of the first
    kind, so that what waits in the camera from before is none of them.
    """
    frames = [take(kind) for kind in [0] * WAITING + ORDER][WAITING:]
    noise = float(np.median([_apart(*pair) for pair in pairwise(frames)]))
    first, other = frames[0], max(frames, key=lambda frame: _apart(frame, frames[0]))
    if not _apart(first, other) > 3 * noise:
        return None, frames
    seen = [int(_apart(frame, other) < _apart(frame, first)) for frame in frames]
    return next(n for n in range(len(ORDER) + 1) if seen[n:] == ORDER[: len(ORDER) - n]), frames


def _apart(one: Array, other: Array) -> float:
    return float(np.sqrt(np.mean((one - other) ** 2)))


def refuse_late(camera: Camera, plane: int) -> None:
    """DeviceError for a camera whose first frame after a change of the exposure is from before it, in steady light."""
    shortest, longest = camera.exposures
    for seconds in np.geomspace(shortest, max(min(longest, LIT), shortest), 4)[1:]:
        times = (shortest, float(seconds))
        count, frames = late(lambda kind, times=times: averaged(camera, times[kind], 1, plane).counts)  # type: ignore[misc]
        if count:
            which = f"frame {count + 1}" if count <= WAITING else f"none of {WAITING + 1} frames"
            raise DeviceError(
                f"{camera.name}: {which} after an exposure was set is the first with it; empty its queue of frames "
                "before each, or trigger each"
            )
        if count == 0:
            return
        if not _dark(frames[0]) and all(np.array_equal(frames[0], frame) for frame in frames):
            raise DeviceError(
                f"{camera.name}: gives one and the same frame, byte for byte, at exposures of {shortest:.2g} and "
                f"{seconds:.2g} s; does it return the last frame again, or ignore its exposure?"
            )


def refuse_miscounted(camera: Camera, seconds: float, plane: int) -> Counts:
    """A picture ``(Hs, Ws)`` of many times an exposure that fills the range, so that bright samples are saturated.

    DeviceError where these have fewer counts than the camera's white.
    """
    short, far = (exposed(camera, each, plane)[0] for each in (0.0, FAR * seconds))
    top, low, unit = int(far.max()), int(np.percentile(far, 1)), step_of(far)
    share, below = np.mean(far == top), np.mean((far < top) & (far >= top - max(0.05 * (top - low), 1)))
    if top - np.percentile(short, 99) > SHALLOWEST and top < camera.white and share > max(MOST_SATURATED, 2 * below):
        shifted = f" (all are multiples of {unit})" if unit > 1 else ""
        raise DeviceError(
            f"{camera.name}: its counts end at {top}{shifted}, below its white of {camera.white:g}; set its white to "
            "that, or its bits"
        )
    return far


def exposed(camera: Camera, seconds: float, plane: int) -> tuple[Counts, float]:
    """One plane of a frame and its exposure [s], within its limits. DeviceError for no photograph."""
    shortest, longest = camera.exposures
    frame, real = camera.expose(min(max(seconds, shortest), longest))
    if frame.ndim == 3:
        frame = frame[..., plane]
    if frame.ndim != 2 or not frame.size or not shortest / 2 <= real <= 2 * longest:
        raise DeviceError(
            f"{camera.name}: a frame of shape {frame.shape} that was exposed for {real:g} s is no photograph; its "
            f"exposures are {shortest:g} to {longest:g} s"
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

    def changed(self, shown: object, plane: int = 0) -> None:
        """The panel and the laser are about to show ``shown``, which may be what they showed before, in a plane."""
        self._plane = plane
        if shown != self._shown:
            self._shown, self._before = shown, self._latest

    def expose(self, seconds: float) -> tuple[Counts, float]:
        """As the camera's own; DeviceError for an old frame, LostDeviceError where all are late from now on."""
        frame, real = self.camera.expose(seconds)
        self._latest = frame.copy()  # a driver may fill the same buffer again
        if self._before is not None and np.array_equal(frame, self._before) and not _dark(frame):
            try:
                refuse_late(self.camera, self._plane)
            except DeviceError as error:
                raise LostDeviceError(f"{error}; mend it, and run again with --retry-failed") from error
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
    seconds, real = float(np.sqrt(shortest * longest)), 0.0
    for _ in range(TRIES):
        before = real
        frame, real = exposed(camera, seconds, plane)
        # dark level and background; where it is not dark at all, the steps are only less exact
        dark, bright = np.percentile(frame, (1, PERCENTILE))
        fill, full = float((bright - dark) / max(camera.white - dark, 1)), float(np.mean(frame >= camera.white))
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
            refuse_miscounted(camera, longest, plane)
            raise DeviceError(
                f"{camera.name}: too little light at its longest exposure of {longest:.2g} s, {fill:.1%} of its range; "
                "is the laser on, the iris open, the lens cap off?"
            )
        if real == before:  # a shutter that knows only some times
            step *= step
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
