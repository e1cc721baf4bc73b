"""A real bench as its users describe it: nominal optics, phase convention, and the devices (``bench:`` of a study)."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, Literal

from annotated_types import Interval, MaxLen, MinLen

from ..core.errors import CellError, UserError
from ..core.hashing import file_state
from ..core.plugins import is_file
from ..core.schema import FieldError, typed
from ..core.yaml_source import load
from ..display.simulated.profile import SMALLEST_PANEL
from ..display.simulated.stages import Panel
from ..imaging.convention import Convention
from ..methods.files.correction import on_panel
from .dark import given_dark
from .drivers.driver import located
from .laser import LaserSettings

LONGEST = 600.0  # seconds
Relative = Annotated[float, Interval(gt=0, le=1)]


@dataclass(frozen=True)
class CaptureSettings:
    """Exposure, averaging, dark frames, bracket and settling of every photograph.

    exposure: seconds, one for each colour channel or one for all, or ``auto``: as long as the test pattern allows;
    average: frames whose mean is taken; dark_frames: frames with the laser off whose mean is taken off; dark: counts
    without light, a level or a file beside the bench file, only where dark_frames is 0; hdr: exposures of a bracket,
    relative to ``exposure``; settle: seconds from showing a hologram to exposing, or ``auto``: measured.
    """

    exposure: Literal["auto"] | float | tuple[float, ...] = "auto"
    average: Annotated[int, Interval(ge=1, le=1000)] = 4
    dark_frames: Annotated[int, Interval(ge=0, le=1000)] = 8
    dark: float | str | None = None
    hdr: Annotated[tuple[Relative, ...], MinLen(1), MaxLen(8)] = (1.0,)
    settle: Literal["auto"] | float = "auto"

    def __post_init__(self) -> None:
        """FieldError, with its place in a bench file."""
        if (self.dark_frames == 0) != (self.dark is not None):
            raise FieldError(
                ("capture", "dark"),
                "capture: either dark frames (dark_frames: 8) or, with dark_frames: 0, the counts without light "
                "(dark: 64, or dark: a file)",
            )
        # by hand, since of a union only the first type's fault would be reported
        for seconds in self.exposure if isinstance(self.exposure, tuple) else (self.exposure,):
            if seconds != "auto" and not 0 < seconds <= LONGEST:
                raise FieldError(
                    ("capture", "exposure"),
                    f"capture.exposure should be auto, or above 0 and at most {LONGEST:g} s, got {seconds:g}",
                )
        if self.settle != "auto" and not 0 <= self.settle <= LONGEST:
            message = f"capture.settle should be auto, or 0 to {LONGEST:g} s, got {self.settle:g}"
            raise FieldError(("capture", "settle"), message)

    def exposures(self, channels: int) -> tuple[float, ...] | None:
        """Seconds for every channel; None for ``auto``. UserError for another number of channels."""
        if self.exposure == "auto":
            return None
        given = self.exposure if isinstance(self.exposure, tuple) else (self.exposure,) * channels
        if len(given) != channels:
            raise UserError(f"capture.exposure has {len(given)} values, but the panel has {channels} wavelengths")
        return given


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
    for key, file in (code := device_files(bench, path.parent)).items():
        if file_state(file) is None:
            raise document.error(tuple(key.split(".")), f"{file}: no such file; expected that of a device's class")
    slm, camera = (
        {key: located(value, path.parent) if isinstance(value, str) else value for key, value in given.items()}
        for given in (bench.slm, bench.camera)
    )
    files = correction + b"".join(file.read_bytes() for file in code.values())
    digest = hashlib.sha256(told.encode() + files).hexdigest()
    return replace(bench, phase=phase, capture=capture, slm=slm, camera=camera, digest=digest)


def device_files(bench: BenchFile, folder: Path) -> dict[str, Path]:
    """The files of a lab's own devices, by the keys that name them; relative paths start in the folder."""
    kinds = (("slm", bench.slm), ("camera", bench.camera))
    names = {f"{kind}.{key}": str(given.get(key)) for kind, given in kinds for key in ("driver", "device")}
    return {key: folder / name.rpartition(":")[0] for key, name in names.items() if is_file(name)}
