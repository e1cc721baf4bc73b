"""A real bench as its users describe it: nominal optics, phase convention, and the devices (``bench:`` of a study)."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any

from annotated_types import Interval, MinLen

from ..core.errors import CellError, UserError
from ..core.schema import typed
from ..core.yaml_source import load
from ..display.simulated.profile import SMALLEST_PANEL
from ..display.simulated.stages import Panel
from ..imaging.convention import Convention
from ..methods.files.correction import on_panel
from .dark import given_dark
from .laser import LaserSettings
from .settings import CaptureSettings


@dataclass(frozen=True)
class BenchFile:
    """A YAML file with these keys.

    version: raised when anything on the bench is changed; panel: nominal optics, as in a profile, and the most frames
    that panel and driver show in one exposure; phase: what the panel's levels mean; slm, camera: ``driver`` and its
    settings; capture: how photographs are taken; laser: how the laser is switched, for several wavelengths. The last
    four are for live use, and may be left out for an exchange of files. residual_bound: largest registration residual
    [region px, rms] with which a study may run.
    """

    name: Annotated[str, MinLen(1)]
    version: Annotated[int, Interval(ge=1)]
    panel: Panel
    description: str = ""
    phase: Convention = field(default_factory=Convention)
    residual_bound: Annotated[float, Interval(gt=0, le=2)] = 0.3
    slm: Mapping[str, Any] = field(default_factory=dict)
    camera: Mapping[str, Any] = field(default_factory=dict)
    capture: CaptureSettings = field(default_factory=CaptureSettings)
    laser: LaserSettings | None = None
    digest: str = field(default="", metadata={"key": False})


def load_bench_file(path: Path) -> BenchFile:
    """Read and check a bench file; every fault is a UserError with file:line:column."""
    if not path.is_file():
        raise UserError(f"bench '{path}': no such file")
    document = load(path)
    bench = typed(document, BenchFile)
    if min(bench.panel.shape) < SMALLEST_PANEL:
        raise document.error(("panel", "shape"), f"a panel has at least {SMALLEST_PANEL} pixels a side")
    if bench.panel.bits != 8:
        raise document.error(("panel", "bits"), f"levels are written with 8 bits, got {bench.panel.bits}")
    for key, fault in bench.panel.faults():
        raise document.error(("panel", key), fault)
    told, capture = document.text, bench.capture
    if isinstance(capture.dark, str):
        file = path.parent / capture.dark
        told += given_dark(str(file))[1]
        capture = replace(capture, dark=str(file.resolve()))
    try:
        phase = on_panel(bench.phase, bench.panel.shape, len(bench.panel.wavelengths), path.parent)
    except CellError as error:
        raise document.error(("phase", "correction"), f"phase: {error}") from error
    correction = (path.parent / phase.correction.file).read_bytes() if phase.correction else b""
    return replace(bench, phase=phase, capture=capture, digest=hashlib.sha256(told.encode() + correction).hexdigest())
