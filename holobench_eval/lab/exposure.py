"""Exposure and what follows from it: frames averaged, dark frames subtracted, brackets combined. All in float."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..imaging.warp import Array
from .dark import Dark
from .devices import Camera, Counts, DeviceError

FILL, PERCENTILE = 0.7, 99.9  # where auto exposure puts which samples, as a part of the range from dark to white
ACCEPTED = 0.6, 1.25  # of FILL: wide enough for shutters that know only full stops
DIMMEST = 0.1  # of the range; less is refused, since the counts are too coarse
TRIES = 16
STRONGEST_STEP = 32.0
FEW = 0.01  # of the samples, which may be hot pixels where no more are at full scale


@dataclass(frozen=True, eq=False)
class Averaged:
    """The mean of some frames: counts ``(Hs, Ws)`` float64, which samples any of them saturates, seconds of each."""

    counts: Array
    saturated: NDArray[np.bool_]
    seconds: float


def averaged(camera: Camera, seconds: float, count: int, plane: int) -> Averaged:
    """Mean of ``count`` frames; plane: the one that is taken of a colour camera's. DeviceError for no good frame."""
    shortest, longest = camera.exposures
    total: Array = np.zeros(())
    saturated: NDArray[np.bool_] = np.zeros((), dtype=bool)
    took = 0.0
    for _ in range(count):
        frame, real = _exposed(camera, min(max(seconds, shortest), longest), plane)
        if total.ndim and total.shape != frame.shape:
            raise DeviceError(f"{camera.name}: a frame of {frame.shape} follows one of {total.shape}")
        total, saturated, took = total + frame, saturated | (frame >= camera.white), took + real
    return Averaged(total / count, saturated, took / count)


def _exposed(camera: Camera, seconds: float, plane: int) -> tuple[Counts, float]:
    frame, real = camera.expose(seconds)
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
        self._latest = frame.copy()  # a driver may fill the same buffer again
        if self._before is not None and np.array_equal(frame, self._before) and not _dark(frame):
            raise DeviceError(f"{self.name}: gave the frame from before the panel changed")
        return frame, real


def _dark(frame: Counts) -> bool:
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
        frame, real = _exposed(camera, seconds, plane)
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
