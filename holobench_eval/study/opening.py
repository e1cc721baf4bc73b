"""Open the displays of a study, each calibrated once in a process."""

from __future__ import annotations

from collections import OrderedDict

import torch

from ..core.device import CPU
from ..core.errors import CellError, UserError
from ..display import CalibratedBench, Profile, load_profile
from ..display.learned import LearnedBench
from ..display.simulated.changes import KINDS, altered
from ..display.simulated.pipeline import SimulatedBench
from ..lab.bench_file import load_bench_file
from ..lab.live import open_live
from ..lab.real import RealBench
from ..lab.session import session_photographer
from ..methods.fiducials import fiducial_phases
from .displays import Condition, RealSource
from .network_display import network_bench

Bench = CalibratedBench | RealBench | LearnedBench

# Limits on the benches that a process keeps open, their pixels in all and their number; two are always kept.
OPEN_PIXELS, OPEN_BENCHES = 8 * 1080 * 1920, 64


def open_display(display: Condition, seed: int, device: torch.device = CPU) -> Bench:
    """The bench of a display, built and calibrated once in a process; a simulated bench is computed on ``device``.

    CellError when its calibration cannot be trusted; a failed calibration is kept and not repeated for every cell.
    """
    place = display.source, display.folder, display.digest, display.spec.shape
    where = None if display.real else device  # a real one is opened once, whoever computes
    key = *place, display.change, display.real, seed, where
    if key not in _open:
        _open[key] = _opened(display, seed, device)
        pixels = display.spec.shape[0] * display.spec.shape[1]
        while len(_open) > max(2, min(OPEN_BENCHES, OPEN_PIXELS // pixels)):
            _open.popitem(last=False)
    _open.move_to_end(key)
    opened = _open[key]
    if isinstance(opened, CellError):
        raise CellError(str(opened)) from opened
    return opened


_open: OrderedDict[object, Bench | CellError] = OrderedDict()  # least recently used first


def simulated(display: Condition, seed: int, device: torch.device = CPU) -> CalibratedBench:
    """``open_display`` of a simulated display."""
    bench = open_display(display, seed, device)
    assert isinstance(bench, CalibratedBench)
    return bench


def forget_sessions() -> None:
    """Drop the real benches, so that the next use opens them anew: files of a session folder may have changed."""
    session_photographer.cache_clear()
    for key in [key for key, bench in _open.items() if not isinstance(bench, CellError) and bench.is_real]:
        del _open[key]


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
    bench = SimulatedBench(profile.scaled(panel), device)
    return CalibratedBench(bench, seed, fiducial_phases, registered_as)


def _opened(display: Condition, seed: int, device: torch.device) -> Bench | CellError:
    if display.real is not None:
        return _open_real(display, display.real, seed)
    profile = load_profile(display.source, folder=display.folder)
    if profile.digest != display.digest:
        raise UserError(f"profile '{display.source}' has changed since the study was planned; start the run again")
    if display.network:
        return network_bench(profile, seed, device)
    unmoved = None
    try:
        if display.change is not None:
            if not KINDS[display.change[0]].moves:
                unmoved = simulated(display.nominal, seed, device)
            profile = altered(profile, *display.change)
        opened = open_bench(profile, display.spec.shape, seed, unmoved, device)
        _ = opened.registration  # calibrated now, so that no method's time includes it
    except CellError as error:
        return error
    return opened


def _open_real(display: Condition, source: RealSource, seed: int) -> RealBench:
    """The bench of a session folder or of devices. UserError for a description that has changed since the plan."""
    bench = None if source.bench is None else load_bench_file(source.bench)
    described = bench or load_profile(display.source, folder=display.folder).scaled(display.spec.shape)
    if described.digest != display.digest:
        raise UserError(f"'{display.source}' has changed since the study was planned; start the run again")
    if source.folder is not None:
        photographer = session_photographer(source.folder)
        return RealBench(display.spec, photographer, described.panel.blaze, described.residual_bound, seed)
    assert bench is not None
    assert source.bench is not None
    return open_live(bench, source.bench.parent, seed, source.slm, source.camera)
