"""Bench profiles: a named, versioned, seeded set of parameters, one YAML file each."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field, replace
from importlib.resources import files
from pathlib import Path
from typing import Annotated

from annotated_types import Interval, MinLen

from ...core.errors import UserError, suggest
from ...core.schema import typed
from ...core.yaml_source import load
from ..api import DisplaySpec, Region
from .stages import (
    AddedLens,
    CoherentNoise,
    Crosstalk,
    Drift,
    Eye,
    Flicker,
    Illumination,
    LookUpTable,
    PixelAperture,
    Propagation,
    Relay,
    Sensor,
    ZeroOrder,
)

SMALLEST_PANEL, LARGEST_PANEL = 64, 8192


@dataclass(frozen=True)
class Panel:
    """The nominal, public part of a profile.

    shape (rows, columns) and distance [m] belong together: on a smaller panel the distance shrinks with the rows.
    pitch [m]; wavelengths [m] of red, green, blue, or a single one; bits; pupil: diameter of the iris as a fraction of
    the band (null: none); blaze: (vertical, horizontal) cycles per pixel that the display adds and re-centres;
    region: side of the scored window as a fraction of the panel's.
    """

    shape: tuple[int, int]
    pitch: Annotated[float, Interval(gt=0, lt=1e-3)]
    wavelengths: tuple[float] | tuple[float, float, float]
    distance: Annotated[float, Interval(gt=0, lt=10)]
    bits: Annotated[int, Interval(ge=1, le=16)]
    pupil: Annotated[float, Interval(gt=0, le=1)] | None = None
    blaze: tuple[float, float] = (0.0, 0.0)
    region: Annotated[float, Interval(gt=0.1, le=1)] = 1.0

    def spec(self, name: str) -> DisplaySpec:
        """The nominal optics of a display of that name."""
        height, width = (max(1, round(self.region * size)) for size in self.shape)
        return DisplaySpec(
            name=name,
            shape=self.shape,
            pitch=self.pitch,
            wavelengths=self.wavelengths,
            distance=self.distance,
            bits=self.bits,
            pupil=self.pupil,
            region=Region((self.shape[0] - height) // 2, (self.shape[1] - width) // 2, height, width),
        )


@dataclass(frozen=True)
class Profile:
    """A simulated bench: the nominal panel, then every stage that light meets, in order.

    sampling: sub-samples per pixel and axis at the panel (crosstalk and fill factor need at least 3);
    residual_bound: largest registration residual [region px, rms] with which a study may run;
    digest: sha256 of the file.
    """

    name: Annotated[str, MinLen(1)]
    version: Annotated[int, Interval(ge=1)]
    seed: int
    description: str
    panel: Panel
    sampling: Annotated[int, Interval(ge=1, le=7)] = 1
    lens: AddedLens = AddedLens()
    lut: LookUpTable = LookUpTable()
    crosstalk: Crosstalk = Crosstalk()
    aperture: PixelAperture | None = None
    flicker: Flicker = Flicker()
    illumination: Illumination = Illumination()
    coherent_noise: CoherentNoise = CoherentNoise()
    propagation: Propagation = field(default_factory=Propagation)
    eye: Eye = Eye()
    zero_order: ZeroOrder = ZeroOrder()
    relay: Relay = Relay()
    sensor: Sensor = Sensor()
    drift: Drift = Drift()
    residual_bound: Annotated[float, Interval(gt=0, le=2)] = 0.3
    digest: str = field(default="", metadata={"key": False})

    def scaled(self, shape: tuple[int, int] | None) -> Profile:
        """The profile on a panel of ``shape``: the pitch stays, the distance scales with the rows.

        Light then spreads over the same fraction of the panel (K / N is constant).
        """
        if shape is None or tuple(shape) == self.panel.shape:
            return self
        if min(shape) < SMALLEST_PANEL or max(shape) > LARGEST_PANEL:
            raise UserError(f"a panel has {SMALLEST_PANEL} to {LARGEST_PANEL} pixels a side, got {list(shape)}")
        distance = self.panel.distance * shape[0] / self.panel.shape[0]
        return replace(self, panel=replace(self.panel, shape=(shape[0], shape[1]), distance=distance))

    def spec(self, shape: tuple[int, int] | None = None) -> DisplaySpec:
        """Nominal optics on a panel of ``shape`` (the profile's own by default)."""
        nominal = self.scaled(shape).panel.spec(self.name)
        return replace(nominal, eye=self.eye.focus) if self.eye.known else nominal

    def scaling_note(self, shape: tuple[int, int] | None) -> str:
        """One sentence for a report on how the panel was scaled."""
        panel, full = self.scaled(shape).panel, self.panel
        if panel == full:
            return f"full panel of {full.shape[0]} x {full.shape[1]} pixels, {full.distance * 1e3:.4g} mm"
        return (
            f"{panel.shape[0]} x {panel.shape[1]} pixels of the full {full.shape[0]} x {full.shape[1]}: the pitch of "
            f"{full.pitch * 1e6:.4g} um stays, the distance goes from {full.distance * 1e3:.4g} to "
            f"{panel.distance * 1e3:.4g} mm, so that light spreads over the same fraction of the panel"
        )


def names() -> list[str]:
    """Names of the profiles that come with the package."""
    folder = files(__package__) / "profiles"
    return sorted(entry.name.removesuffix(".yaml") for entry in folder.iterdir() if entry.name.endswith(".yaml"))


def load_profile(name: str, folder: Path | None = None) -> Profile:
    """A profile by name, or from a YAML file (path relative to ``folder`` first); UserError with file:line:column."""
    if name.endswith((".yaml", ".yml")):
        candidates = [Path(name)] if folder is None else [folder / name, Path(name)]
        path = next((path for path in candidates if path.is_file()), None)
        if path is None:
            raise UserError(f"profile '{name}': no such file: {candidates[0]}")
    elif name in names():
        path = Path(str(files(__package__) / "profiles" / f"{name}.yaml"))
    else:
        raise UserError(f"unknown profile '{name}'; {suggest(name, names())}, or a path to a .yaml file")
    document = load(path)
    profile = typed(document, Profile)
    if profile.lut.table and len(profile.lut.table) != 2**profile.panel.bits:
        levels = 2**profile.panel.bits
        message = f"the table has {len(profile.lut.table)} entries; a panel of {profile.panel.bits} bits has {levels}"
        raise document.error(("lut", "table"), message)
    return replace(profile, digest=hashlib.sha256(document.text.encode()).hexdigest())
