"""Open the devices of a bench file and check the bench, one line a step, before any study runs on it."""

from __future__ import annotations

import atexit
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..core.errors import UserError
from ..methods.wirtinger import Wirtinger
from .bench_file import BenchFile
from .devices import Camera, DeviceError, SequenceSlm, Slm
from .drivers.catalogue import checked_params, open_device
from .drivers.worker import closed_on_failure
from .laser import laser
from .photograph import Request
from .real import RealBench
from .rig import Rig
from .test_pattern import draw_pattern

# of the test pattern's hologram: a smooth phase would leave a ghost on the wrong side of the panel
SOLVER = Wirtinger(iterations=30, initial_phase="random")


def open_live(bench: BenchFile, folder: Path, seed: int, slm: Slm | None, camera: Camera | None) -> RealBench:
    """The bench, checked; its devices are given back when the program ends. UserError in one line for what is wrong.

    folder: where relative paths of the bench file start; slm, camera: in the place of those of the file.
    """
    spec = bench.panel.spec(bench.name)
    lasers = laser(bench.laser, len(spec.wavelengths), folder, _ask)
    slm, camera = _devices(bench, slm, camera)
    rig = Rig(slm, camera, bench.phase, bench.capture, spec.wavelengths, lasers)
    atexit.register(rig.close)
    print(f"panel: {slm.name}; camera: {camera.name}")
    real = RealBench(spec, rig, bench.panel.blaze, bench.residual_bound, seed)
    rig.prepare(letter(real), print)
    return real


def letter(bench: RealBench) -> Request:
    """The hologram of the test pattern, as `preflight.phase_sign` wants it."""
    spec = bench.spec
    target = draw_pattern(spec.region.shape).float().expand(len(spec.wavelengths), -1, -1)
    handle = bench.for_method(SOLVER, "letter", target, "letter", 0)  # names that its seed depends on
    phase = SOLVER.solve(target[None], handle)[0]
    return Request(bench.shown(phase), bench.relative_exposure(target), "letter", ())


def _devices(bench: BenchFile, slm: Slm | None, camera: Camera | None) -> tuple[Slm, Camera]:
    if camera is None:
        checked_params("camera", *_driver("camera", bench.camera))  # before a panel is opened for nothing
    try:
        slm = slm or open_device("slm", *_driver("slm", bench.slm))
        with closed_on_failure(slm.close):
            if slm.shape != bench.panel.shape:
                shape = list(bench.panel.shape)
                raise UserError(f"panel.shape is {shape}, but {slm.name} has {list(slm.shape)} pixels")
            if bench.panel.frames > 1 and not isinstance(slm, SequenceSlm):
                raise UserError(
                    f"panel.frames is {bench.panel.frames}, but {slm.name} shows one pattern an exposure; "
                    "leave it out, give the driver show_sequence, or exchange files (holoeval session)"
                )
            return slm, camera or open_device("camera", *_driver("camera", bench.camera))
    except DeviceError as error:
        raise UserError(f"bench '{bench.name}': {error}") from error


def _driver(key: str, given: Mapping[str, Any]) -> tuple[str, dict[str, Any]]:
    if "driver" not in given:
        raise UserError(f"{key}: names no driver; a live study needs one, an exchange of files (holoeval session) none")
    return str(given["driver"]), {name: value for name, value in given.items() if name != "driver"}


def _ask(line: str) -> None:
    input(f"{line}; then press Enter ")
