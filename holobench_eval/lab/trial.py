"""What the pictures of devices look like, before there is a bench: ``holoeval doctor my_camera.py:Mine``."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ..core.errors import UserError
from ..imaging.standing_out import hot_and_dead
from .bench_file import load_bench_file
from .dark import Dark
from .devices import Camera, DeviceError, Slm
from .drivers.catalogue import open_device
from .drivers.driver import Kind, load
from .drivers.own import NEEDS
from .exposure import auto_exposure, averaged, exposed, refuse_late, refuse_miscounted
from .preflight import Check, linearity
from .settle import Toggle, settle_time

PLANE = 1  # of a colour camera: green


def tried(names: Sequence[str], wait: Callable[[float], None] = time.sleep) -> Iterator[Check]:
    """Open devices, ``path/to/file.py:Class`` or those of a bench file, and look at pictures of them, a line each.

    wait: how to pass seconds. UserError: there is no such device.
    """
    with ExitStack() as stack:
        opened: dict[Kind, Any] = {}
        try:
            for kind, driver, params in (each for name in names for each in _named(name)):
                opened[kind] = open_device(kind, driver, params)
                stack.callback(opened[kind].close)
            yield from _looked_at(opened.get("slm"), opened.get("camera"), wait)
        except DeviceError as error:
            yield Check(False, str(error))


def _named(name: str) -> list[tuple[Kind, str, dict[str, Any]]]:
    if ":" not in name:
        bench = load_bench_file(Path(name))
        given: list[tuple[Kind, dict[str, Any]]] = [("slm", dict(bench.slm)), ("camera", dict(bench.camera))]
        return [(kind, str(params.pop("driver")), params) for kind, params in given if "driver" in params]
    cls = load(name, "device")
    for kind, needs in NEEDS.items():
        if hasattr(cls, next(iter(needs))):
            return [(kind, name, {})]
    raise UserError(f"device '{name}' is no class with show(levels), as a panel, or expose(seconds), as a camera")


def _looked_at(slm: Slm | None, camera: Camera | None, wait: Callable[[float], None]) -> Iterator[Check]:
    shape = (1, 1) if slm is None else slm.shape
    even, noise = np.zeros(shape, np.uint8), np.random.default_rng(0).integers(0, 256, shape, np.uint8)
    if slm is not None:
        slm.show(even)
        yield Check(True, f"{slm.name}: {shape[0]} x {shape[1]} pixels")
    if camera is None:
        return
    refuse_late(camera, PLANE)
    seconds = auto_exposure(camera, PLANE)
    bright, (frame, real) = refuse_miscounted(camera, seconds, PLANE), exposed(camera, seconds, PLANE)
    yield Check(True, f"{camera.name}: {frame.shape[0]} x {frame.shape[1]} samples of {frame.dtype}, no old frames")
    yield Check(True, f"counts: up to {bright.max()} of {camera.white:g}, {int(bright.max()).bit_length()} bits")
    short = averaged(camera, 0.0, 4, PLANE)  # the light is on: what it adds in this time is taken off
    rate = (frame - short.counts) / max(real - short.seconds, short.seconds)
    black = float(np.median(short.counts - rate * short.seconds))
    yield Check(True, f"black: {black:.1f} counts")
    lit = np.mean(frame >= camera.white)
    yield Check(True, f"exposure: {seconds:.3g} s, {lit:.2%} of the samples saturated")
    yield Check(True, f"hot pixels: {np.count_nonzero(hot_and_dead(frame.astype(np.float32))[0])}")
    yield linearity(partial(averaged, camera, count=1, plane=PLANE), seconds, Dark(np.array(black)))
    if slm is not None:
        toggle = Toggle(
            show=lambda lit: slm.show(even if lit else noise),
            take=lambda: averaged(camera, seconds, 1, PLANE).counts,
            wait=wait,
        )
        yield Check(True, f"settling: {settle_time(toggle) * 1e3:.0f} ms")
