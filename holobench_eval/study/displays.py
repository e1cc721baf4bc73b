"""The displays of a study, as its config names them; nothing is opened here."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from ..core import plugins
from ..core.hashing import digest
from ..display import DisplaySpec, load_profile
from ..display.resolution import refuse_far
from ..display.simulated.changes import KINDS, Value, altered
from ..lab.bench_file import load_bench_file
from ..lab.devices import Camera, Slm
from ..lab.session import read_manifest
from . import isolation
from .definition import LEARNED, Study, Training
from .versions import dataset_version, method_version

Panel = tuple[int, int]


@dataclass(frozen=True)
class RealSource:
    """Where the photographs of a display that exists come from.

    bench: the file that describes it (None: a profile's panel does); folder, session: the folder that photographs are
    exchanged in, and its name (none: devices take them); slm, camera: these, open, in the place of the bench file's.
    """

    bench: Path | None = None
    folder: Path | None = None
    session: str = ""
    slm: Slm | None = None
    camera: Camera | None = None


@dataclass(frozen=True)
class Condition:
    """A display that a study shows its methods on.

    source: the profile's name or path as the config gives it; folder: where a relative path starts; name,
    version, digest: those of the profile; spec: its nominal optics at the study's panel size; learned: what has to be
    prepared for a display that is a trained network (the other fields are those of the display it was trained on,
    except for its name); change: kind and value of what has changed on it since methods were prepared (None: nothing);
    real: where its photographs come from (None: it is simulated); network: whether the profile is a trained network.
    """

    source: str
    folder: Path
    name: str
    version: int
    digest: str
    spec: DisplaySpec
    learned: Preparation | None = None
    change: tuple[str, Value] | None = None
    real: RealSource | None = None
    network: bool = False

    @property
    def in_session(self) -> bool:
        """Whether people photograph it, in the folder of a session."""
        return self.real is not None and self.real.folder is not None

    @property
    def nominal(self) -> Condition:
        """The display before the change."""
        return replace(self, change=None)

    @property
    def title(self) -> str:
        """Its name in tables, with the change: ``leto-aged, drift 30 days``."""
        if self.change is None:
            return self.name
        kind, value = self.change
        amount = f"{value:.10g}" if isinstance(value, float) else value
        return f"{self.name}, " + " ".join(part for part in (kind.replace("_", " "), amount, KINDS[kind].unit) if part)


@dataclass(frozen=True)
class Preparation:
    """What a method has to learn before it can solve: the name of its artifact follows from it.

    method, params: as in a cell; version: of the method's code (``versions.method_version``); folder: the config's
    folder; display: the one it is trained on; training: the study's, with the source of the images; images: name and
    digest of each; images_version: of the code of a user's dataset (``versions.dataset_version``); seed: the study's;
    external: digests of files that the method takes where a machine has them (empty: it takes none).
    """

    method: str
    version: str
    params: Mapping[str, Any]
    folder: Path
    display: Condition
    training: Training
    images: tuple[tuple[str, str], ...]
    seed: int
    external: Mapping[str, str] = field(default_factory=dict)
    images_version: str = ""

    def description(self) -> dict[str, Any]:
        """Everything that the learned state depends on, as plain JSON values.

        The harness version is not part of it, so that a faster bench does not cost a day of training;
        ``provenance.json`` records it.
        """
        spec = self.display.spec
        return {
            "method": self.method,
            "version": self.version,
            "params": dict(self.params),
            "profile": self.display.name,
            "profile_version": self.display.version,
            "panel": list(spec.shape),
            "wavelengths": list(spec.wavelengths),
            "pitch": spec.pitch,
            "distance": spec.distance,
            "profile_sha256": self.display.digest,
            "training": self.training.dataset,
            "training_params": dict(self.training.params),
            "training_sha256": digest([list(image) for image in self.images]),
            "held_out": self.training.held_out,
            "captures": self.training.captures,
            "seed": self.seed,
            **({"external": dict(self.external)} if self.external else {}),
            **({"images_version": self.images_version} if self.images_version else {}),
            **({"session": self.display.real.session} if self.display.real else {}),
        }

    @cached_property
    def id(self) -> str:
        """sha256 of the description."""
        return digest(self.description())

    @property
    def name(self) -> str:
        """The folder of its artifact: readable, and different for every description."""
        rows, columns = self.display.spec.shape
        method = self.method.rpartition(":")[2]
        return f"{method}-{self.display.name}-{rows}x{columns}-{self.id[:10]}"


def preparation(study: Study, method: str, params: Mapping[str, Any], display: Condition) -> Preparation | None:
    """What ``method`` has to learn before it is shown on ``display``; None for a method that learns nothing.

    For a learned display, a method is trained on the display that the network was trained on.
    """
    traits, dataset = isolation.traits(method, study.folder), study.training.dataset
    if not traits.trains:
        return None
    return Preparation(
        method=method,
        version=method_version(isolation.find(method, study.folder)),
        params=params,
        folder=study.folder,
        display=display.learned.display if display.learned else display,
        training=study.training,
        images=study.training_images,
        seed=study.seed,
        images_version=dataset_version(dataset, plugins.find("datasets", dataset, study.folder)),
        external=isolation.external(isolation.build(method, params, study.folder))
        if "external" in traits.functions
        else {},
    )


def displays(study: Study) -> dict[str, Condition]:
    """The displays of a study by the names they have in its config."""
    grid, learned = study.display, study.display.learned
    if grid.bench is not None:
        return {grid.bench: _real(study, real_condition(grid.bench, study.folder))}
    if learned is None:
        return {source: _real(study, condition(source, grid.panel, study.folder)) for source in grid.profiles}
    display = condition(learned.profile, grid.panel, study.folder)
    name = f"{learned.method.rpartition(':')[2]} trained on {display.name}"
    return {LEARNED: replace(display, name=name, learned=preparation(study, learned.method, learned.params, display))}


def condition(source: str, panel: Panel | None, folder: Path) -> Condition:
    """Read a profile without building its bench. UserError: unknown profile, or a panel or distance it cannot have."""
    profile = load_profile(source, folder=folder)
    spec = profile.spec(panel)
    refuse_far(spec, profile.panel.distance)
    network = profile.network.method is not None
    return Condition(source, folder, profile.name, profile.version, profile.digest, spec, network=network)


def real_condition(source: str, folder: Path, slm: Slm | None = None, camera: Camera | None = None) -> Condition:
    """Read the file of a real bench without opening its devices. UserError for an invalid file."""
    bench, real = load_bench_file(folder / source), RealSource(folder / source, slm=slm, camera=camera)
    spec = bench.panel.spec(bench.name)
    refuse_far(spec, spec.distance)
    return Condition(source, folder, bench.name, bench.version, bench.digest, spec, real=real)


def _real(study: Study, display: Condition) -> Condition:
    """The display, with its photographs from the study's session folder if there is one."""
    folder = study.display.session
    if folder is None:
        return display
    session = read_manifest(folder).session
    return replace(display, real=replace(display.real or RealSource(), folder=folder, session=session))


def changed(study: Study, source: str, display: Condition) -> list[Condition]:
    """A display as methods were prepared for it, and after every change that the study's sweeps make to it."""
    found = [display]
    for sweep in study.sweeps:
        if source in sweep.profiles:
            profile = load_profile(display.source, folder=display.folder)
            for value in sweep.values:
                if value != KINDS[sweep.condition].nominal:
                    spec = replace(display.spec, eye=altered(profile, sweep.condition, value).spec().eye)
                    found.append(replace(display, change=(sweep.condition, value), spec=spec))
    return found
