"""Bench profiles: a named, versioned, seeded set of parameters, one YAML file each; the list of stages."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from importlib.resources import files
from itertools import accumulate
from pathlib import Path
from typing import Annotated, Any, get_args, get_type_hints

from annotated_types import Interval, MinLen

from ...core.errors import UserError, suggest
from ...core.schema import typed
from ...core.yaml_source import Document, load
from ..api import DisplaySpec
from . import stages as kinds
from .maps import KEYS, MapFile, load_maps
from .network import NetworkFile
from .shelf import installed, shelves
from .stage import Effect, Stage
from .trust import Trust

PROFILES = Path(str(files(__package__) / "profiles"))
FAMILY = PROFILES / "family"
SMALLEST_PANEL, LARGEST_PANEL = 64, 8192
SMALLEST_GAMMA, STEEPEST = 0.2, 4  # of a look-up table; the furthest place of its exponent from the mean [rms]
DEEPEST = 4  # profiles in a row that are like one another


@dataclass(frozen=True)
class Profile:
    """A simulated bench: the nominal panel, then every stage, a field each, in the order in which light meets them.

    Parameters
    ----------
    name
        What the display is called; with the seed it draws every random pattern.
    version
        A change of any value is a new version.
    seed
        Of the random patterns.
    description
        One sentence for reports.
    panel
        The nominal, public part: what methods are told.
    sampling
        Sub-samples a pixel and axis at the panel; crosstalk and fill factor need at least 3 [count].
    lens to drift
        The stages. ``dust_plane`` has no keys of its own: its parameters are in ``coherent_noise``.
    residual_bound
        Largest registration residual with which a study may run [region px, rms].
    maps
        A file of measured maps, which act in the place of what stages draw.
    network
        A trained method that predicts captures, in the place of the stages; without noise.
    twin
        Of a profile that was learned from photographs of a display: how far it can stand for that.
    like
        A profile, by name or file (from the folder of this one), whose values hold where this file gives none.
    digest
        sha256 of the file, and of those it is like; the file of maps has one of its own, which stands there.

    Examples
    --------
    >>> profile = load_profile("leto-aged").scaled((256, 256))
    >>> profile.panel.shape, profile.spec().bits
    ((256, 256), 8)
    >>> [effect.name for effect in load_profile("ideal").effects()]
    ['quantisation']
    """

    name: Annotated[str, MinLen(1)]
    version: Annotated[int, Interval(ge=1)]
    seed: int
    description: str
    panel: kinds.Panel
    sampling: Annotated[int, Interval(ge=1, le=7)] = 1
    lens: kinds.AddedLens = kinds.AddedLens()
    lut: kinds.LookUpTable = kinds.LookUpTable()
    crosstalk: kinds.Crosstalk = kinds.Crosstalk()
    aperture: kinds.PixelAperture | None = None
    flicker: kinds.Flicker = kinds.Flicker()
    spectrum: kinds.Spectrum = kinds.Spectrum()
    illumination: kinds.Illumination = kinds.Illumination()
    coherent_noise: kinds.CoherentNoise = kinds.CoherentNoise()
    propagation: kinds.Propagation = field(default_factory=kinds.Propagation)
    eye: kinds.Eye = kinds.Eye()
    zero_order: kinds.ZeroOrder = kinds.ZeroOrder()
    dust_plane: kinds.DustPlane = field(default=kinds.DustPlane(), metadata={"key": False})
    stray_light: kinds.StrayLight = kinds.StrayLight()
    relay: kinds.Relay = kinds.Relay()
    sensor: kinds.Sensor = kinds.Sensor()
    drift: kinds.Drift = kinds.Drift()
    residual_bound: Annotated[float, Interval(gt=0, le=2)] = 0.3
    maps: MapFile = MapFile()
    network: NetworkFile = NetworkFile()
    twin: Trust = Trust()
    like: str | None = None
    digest: str = field(default="", metadata={"key": False})

    @property
    def stages(self) -> list[Stage]:
        """The stages, in the order in which light meets them."""
        return [stage for name in STAGES if (stage := getattr(self, name)) is not None]

    def effects(self) -> list[Effect]:
        """Every effect, in the order in which light meets them; those that are switched off are left out."""
        if self.network.method:
            return [Effect("network", f"all that a trained {self.network.method} predicts")]
        return [effect for stage in self.stages for effect in stage.effects(self)]

    @property
    def held(self) -> list[str]:
        """Names of the maps that its stages hold, of ``maps.KEYS``."""
        return [key for key in KEYS if (name := key.split("."))[1] in getattr(self, name[0]).maps]

    def faults(self) -> Iterator[tuple[tuple[str, ...], str]]:
        """Keys whose values do not go together, and why; those of maps apart, which are read later."""
        yield from ((("panel", key), fault) for key, fault in self.panel.faults())
        yield from (*self.plane_faults(), *self.network_faults())
        if fault := self.panel.fault_of(self.lut.table):
            yield ("lut", "table"), fault
        if self.lut.bend and self.lut.table:
            yield ("lut", "bend"), "a table has no exponent to bend; give gamma in the place of the table"
        if min(self.lut.gamma) < SMALLEST_GAMMA + STEEPEST * self.lut.bend:
            yield ("lut", "bend"), f"{self.lut.bend:g} bends some exponents to zero"
        spectra, colours = len(self.spectrum.measured), len(self.panel.wavelengths)
        if spectra not in (0, colours):
            yield ("spectrum", "measured"), f"there are {spectra} measured spectra; the panel has {colours} wavelengths"

    def map_faults(self) -> Iterator[tuple[tuple[str, ...], str]]:
        """Keys that maps have taken the place of, and that are given nevertheless; a table for other levels."""
        for key in self.held:
            stage, name = key.split(".")
            own, neutral = getattr(self, stage), STAGES[stage]()
            for other in KEYS[key].instead:
                if getattr(own, other) != getattr(neutral, other):
                    yield (stage, other), f"{stage}.{other} has no effect beside the map {key}"
            if key == "lut.table" and own.maps[name].shape[1] != 2**self.panel.bits:
                yield ("panel", "bits"), f"the map {key} has {own.maps[name].shape[1]} levels, not {2**self.panel.bits}"

    def network_faults(self) -> Iterator[tuple[tuple[str, ...], str]]:
        """Stages and maps beside a network, which has no place for them."""
        if self.network.method:
            neutral = Profile(self.name, self.version, self.seed, self.description, self.panel)
            for name in (*STAGES.keys() - {"panel"}, "maps", "sampling"):
                if getattr(self, name) != getattr(neutral, name):
                    yield (name,), f"'{name}' has no effect beside a network"

    def plane_faults(self) -> Iterator[tuple[tuple[str, ...], str]]:
        """Keys that have no meaning in a Fourier plane, and why."""
        if self.panel.plane == "fresnel":
            return
        for where, given in (
            (("propagation", "pupil_shift"), any(self.propagation.pupil_shift)),
            (("propagation", "obstruction"), self.propagation.obstruction > 0),
            (("coherent_noise", "plane_specks"), self.coherent_noise.plane_specks > 0),
            (("lens", "move"), any(self.lens.move)),
            (("eye", "focus"), any(self.eye.focus)),
            (("eye", "pupil"), self.eye.pupil is not None),
        ):
            if given:
                yield where, f"{'.'.join(where)} is for an image in a Fresnel plane, and this one is in a Fourier plane"

    def scaled(self, shape: tuple[int, int] | None) -> Profile:
        """The profile on a smaller panel: the pitch stays, the distance scales with the rows.

        Light then spreads over the same fraction of the panel (K / N is constant).

        Parameters
        ----------
        shape
            Rows and columns, None for the profile's own.

        Raises
        ------
        UserError
            A side below 64 or above 8192 pixels, or longer than that of the panel; rows and columns in the other order;
            a panel with maps on another size than its own.
        """
        if shape is None:
            return self
        if min(shape) < SMALLEST_PANEL or max(shape) > LARGEST_PANEL:
            raise UserError(f"a panel has {SMALLEST_PANEL} to {LARGEST_PANEL} pixels a side, got {list(shape)}")
        own = self.panel.shape
        if tuple(shape) == own[::-1] != own:
            sides = f"{own[0]} rows and {own[1]} columns"
            raise UserError(f"'{self.name}' has {sides}; rows come first: {list(own)}, not {list(shape)}")
        if tuple(shape) == own:
            return self
        if self.held or self.network.method:
            what, size = "maps" if self.held else "a network", f"{own[0]} x {own[1]}"
            raise UserError(
                f"'{self.name}' has {what} of its panel of {size} pixels; give that panel, not {list(shape)}"
            )
        rows, columns = shape
        if rows > own[0] or columns > own[1]:
            raise UserError(
                f"the panel of '{self.name}' has {own[0]} x {own[1]} pixels, not {list(shape)}; give at most these"
            )
        distance = self.panel.distance * rows / own[0]
        return replace(self, panel=replace(self.panel, shape=(rows, columns), distance=distance))

    @property
    def usual(self) -> tuple[int, int]:
        """The panel where none is asked for: 256 x 256 pixels of it, or its own where it is smaller or has maps."""
        rows, columns = self.panel.shape
        return (rows, columns) if self.held or self.network.method else (min(rows, 256), min(columns, 256))

    def spec(self, shape: tuple[int, int] | None = None) -> DisplaySpec:
        """Nominal optics on a panel of ``shape`` (the profile's own by default)."""
        nominal = self.scaled(shape).panel.spec(self.name)
        return replace(nominal, eye=self.eye.focus) if self.eye.known else nominal

    def scaling_note(self, shape: tuple[int, int] | None) -> str:
        """One sentence for a report on how the panel was scaled."""
        panel, full = self.scaled(shape).panel, self.panel
        if panel == full:
            return f"full panel of {full.shape[0]} x {full.shape[1]} pixels, {full.distance * 1e3:.4g} mm"
        length = "distance" if panel.plane == "fresnel" else "focal length"
        return (
            f"{panel.shape[0]} x {panel.shape[1]} pixels of the full {full.shape[0]} x {full.shape[1]}: the pitch of "
            f"{full.pitch * 1e6:.4g} um stays, the {length} goes from {full.distance * 1e3:.4g} to "
            f"{panel.distance * 1e3:.4g} mm, so that light spreads over the same fraction of the panel"
        )


STAGES: dict[str, type[Stage]] = {
    name: kind
    for name, hint in get_type_hints(Profile).items()
    for kind in (*get_args(hint), hint)
    if isinstance(kind, type) and issubclass(kind, Stage)
}
"""Every stage by its key in a profile, in the order in which light meets them: the fields of ``Profile``."""


def names(family: bool = False) -> list[str]:
    """Names of the profiles that come with the package; those of a family are many, and given on their own."""
    return sorted(path.stem for path in (FAMILY if family else PROFILES).glob("*.yaml"))


def load_profile(name: str, folder: Path | None = None) -> Profile:
    """A profile by name or from a file.

    Parameters
    ----------
    name
        One of ``names()`` or of ``shelf.installed()``, or the path of a YAML file.
    folder
        Where a relative path is looked for first.

    Raises
    ------
    UserError
        There is no such profile, or its file has a fault, with ``file:line:column``.
    """
    documents = _documents(name, folder)
    text = "".join(each.text for each in documents)
    documents.reverse()  # a fault of a base is told of its own file
    merged = accumulate((each.data for each in documents), _over)
    for document, values in zip(documents, merged, strict=True):
        profile = typed(document, Profile, values)
        for where, fault in profile.faults():
            raise document.error(where, fault)
    if profile.maps.file is not None:
        profile = _with_maps(profile, documents)
    if profile.network.method is not None:
        profile = _with_network(profile, documents)
    trust = profile.twin if "twin" in documents[-1].data else Trust()  # of this file, and of none that is like it
    return replace(profile, twin=trust, digest=hashlib.sha256(text.encode()).hexdigest())


def profile_files(name: str, folder: Path | None = None) -> list[Path]:
    """The files of a profile and of those it is like, its own first. UserError as ``load_profile``."""
    return [Path(document.name) for document in _documents(name, folder)]


def _with_maps(profile: Profile, documents: Sequence[Document]) -> Profile:
    """The profile whose stages hold the maps of its file, from the folder of the last document that speaks of it."""
    panel, named = profile.panel, [each for each in documents if "maps" in each.data][-1]
    rows, columns = panel.shape
    sizes = {"colours": len(panel.wavelengths), "levels": 2**panel.bits, "rows": rows, "columns": columns}
    try:
        loaded = load_maps(profile.maps, Path(named.name).parent, sizes)
    except UserError as error:
        raise named.error(("maps", "file"), str(error)) from error
    for key, values in loaded.items():
        stage, name = key.split(".")
        own = getattr(profile, stage)
        profile = replace(profile, **{stage: replace(own, maps={**own.maps, name: values})})
    for where, fault in profile.map_faults():
        raise documents[-1].error(where, fault)
    return profile


def _with_network(profile: Profile, documents: Sequence[Document]) -> Profile:
    """The profile with the path of its network, in the folder of the last document that speaks of it."""
    named = [each for each in documents if "network" in each.data][-1]
    try:
        path = profile.network.found(Path(named.name).parent)
    except UserError as error:
        raise named.error(("network", "file"), str(error)) from error
    return replace(profile, network=replace(profile.network, file=str(path)))


def _documents(name: str, folder: Path | None) -> list[Document]:
    """The file of a profile, that of the profile it is like, and so on. UserError: one of them is not there."""
    path = _file(name, Path() if folder is None else folder, Path())
    documents = [load(path)]
    while (base := documents[-1].data.get("like")) is not None:
        if len(documents) == DEEPEST:
            raise documents[0].error(("like",), f"more than {DEEPEST} profiles, each of them like the next")
        try:
            path = _file(str(base), path.parent)
        except UserError as error:
            raise documents[-1].error(("like",), str(error)) from error
        documents.append(load(path))
    return documents


def _over(base: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """The values of a profile with those of another in their place, key by key."""
    nested = {
        key: _over(base[key], value)
        for key, value in changes.items()
        if isinstance(value, Mapping) and isinstance(base.get(key), Mapping)
    }
    return {**base, **changes, **nested}


def _file(name: str, *folders: Path) -> Path:
    """Where a profile's file is: among those of a package, or in the first of the folders that has it."""
    if name.endswith((".yaml", ".yml")):
        candidates = [folder / name for folder in folders]
        path = next((path for path in candidates if path.is_file()), None)
        if path is None:
            raise UserError(f"profile '{name}': no such file: {candidates[0]}")
        return path
    package, _, own = name.rpartition("/")
    if package and package in shelves():
        return shelves()[package].file(own)
    path = next((path for path in (PROFILES / f"{name}.yaml", FAMILY / f"{name}.yaml") if path.is_file()), None)
    if path is None or package:
        known = suggest(name, [*names(), *installed()])
        raise UserError(f"unknown profile '{name}'; {known}, or a path to a .yaml file")
    return path
