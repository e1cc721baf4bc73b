"""From the photographs of a study to the twin of their display, and to the study that tries it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import torch
import yaml
from torch import Tensor

from ..core.device import CPU
from ..core.errors import CellError, UserError
from ..core.installed import shipped_configs
from ..core.io import file_name
from ..core.yaml_source import load
from ..display import CalibratedBench, Profile, load_profile
from ..display.learned import LearnedBench
from ..display.simulated.profile import STAGES
from ..display.simulated.stages import Sensor
from ..lab.bench_file import load_bench_file
from ..lab.session import read_manifest
from ..lab.session.manifest import FILE as MANIFEST
from ..methods.files.arrays import read_array
from ..methods.twin.method import learned_twin
from ..methods.twin.to_profile import to_profile, write_profile
from ..metrics import match
from .artifacts import Artifact, Artifacts
from .config import load_study
from .definition import MethodEntry, Study
from .displays import Condition, displays
from .folders.session import ARTIFACTS, REPORT, study_of
from .isolation import traits
from .network_display import network_bench, predictor, write_network
from .opening import open_bench
from .plan import Cell, Plan, plan
from .scoring.picture import refuse_saturated
from .scoring.scores import kept_capture
from .store import Store

WORK = "work"  # in the folder of a twin: the study of the photographs, and the displays of the trial
PHOTOGRAPHS, TRIAL = "photographs", "trial"
OVER_PANEL = ("lut.gain", "illumination.amplitude", "illumination.phase")
NOISY = 2  # pictures of each method, which tell the noise of a camera
SCORE = "psnr_linear"
OF_PROFILES = {"seed", "like", "sampling", "maps"}
FEWEST = 3  # pictures, and methods: two without a camera, whose difference is compared, and the twin


def study_text(display: str, panel: tuple[int, int], pictures: int, network: str | None = None) -> str:
    """The config of the photographs of a display: a profile, by name or file, or the file of a bench.

    network: a method that learns the display in the place of the twin's equations.
    """
    config = yaml.safe_load(shipped_configs()["twin"].read_bytes())
    path = Path(display)
    shown = str(path.resolve()) if path.is_file() else display
    config["title"] = f"Photographs for a twin of {path.stem if path.is_file() else display}"
    config["display"] = {"bench": shown} if is_bench(path) else {"profiles": [shown], "panel": list(panel)}
    config["targets"]["params"]["count"] = pictures
    config["methods"] = [network if network and each == "twin" else each for each in config["methods"]]
    return yaml.safe_dump(config, sort_keys=False)


def refuse_fourier(display: str) -> None:
    """UserError for a display, as `study_text` takes it, whose picture is in a Fourier plane."""
    path = Path(display)
    if (load_bench_file(path) if is_bench(path) else load_profile(display)).panel.plane == "fourier":
        raise UserError(f"{display}: has its picture in a Fourier plane; the model of a twin has a Fresnel plane")


def is_bench(path: Path) -> bool:
    """Whether a file describes a bench with devices: it has nothing that a profile alone has."""
    if not path.is_file():
        return False
    try:
        data = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (yaml.YAMLError, UnicodeDecodeError):
        return False  # which load_profile says with its place
    return isinstance(data, dict) and not data.keys() & (OF_PROFILES | STAGES.keys() - {"panel"})


@dataclass(frozen=True)
class Photographed:
    """A study whose photographs are taken. output: of its records; artifacts: what its methods have learned."""

    study: Study
    output: Path
    artifacts: Path

    @cached_property
    def plan(self) -> Plan:
        """Its plan."""
        return plan(self.study)

    @cached_property
    def display(self) -> Condition:
        """Its one display. UserError: it has several."""
        own = list(displays(self.study).values())
        if len(own) != 1:
            raise UserError(f"{self.study.file}: {len(own)} displays; a twin is of one")
        return own[0]

    @cached_property
    def row(self) -> MethodEntry:
        """The method that has learned the display: the twin, or where there is none the one that predicts captures.
        UserError: there are none or several."""
        rows = [entry for entry in self.study.methods if entry.name == "twin"] or [
            entry
            for entry in self.study.methods
            if (own := traits(entry.name, self.study.folder)).trains and "predict" in own.functions
        ]
        if len(rows) != 1:
            raise UserError(f"{self.study.file}: {len(rows)} methods learn the display; expected one, such as twin")
        return rows[0]

    @cached_property
    def own(self) -> dict[tuple[str, str], list[Cell]]:
        """The cells of methods by label and target, in the order of repeats."""
        found: dict[tuple[str, str], list[Cell]] = {}
        for label, cell in self.plan.labelled():
            if cell.code:
                found.setdefault((label, cell.target), []).append(cell)
        return found

    def captures(self, cell: Cell) -> tuple[Tensor, float]:
        """The kept capture ``(C, h, w)`` of a cell, and its PSNR [dB]. UserError: it was not taken, or is damaged."""
        store = Store(self.output)
        record, kept = store.read(cell.id), kept_capture(store.capture(cell.id))
        if record is None or record.state != "done" or not kept:
            state = "waits for its photograph" if record is None else record.reason or "has lost its capture"
            raise UserError(f"{self.output}: {cell.method} on {cell.target} {state}; a twin needs every cell")
        if SCORE not in record.values():
            raise UserError(f"{self.study.file}: measures no psnr; a twin is told by it")
        return kept[0], record.values()[SCORE]

    def target(self, item: str) -> Tensor:
        """A picture ``(C, h, w)`` of linear light, as the display is to show it."""
        spec = self.display.spec
        picture: Tensor = self.study.dataset.load(item, spec.region.shape, channels=len(spec.wavelengths))
        return picture

    @cached_property
    def twice(self) -> list[tuple[str, str]]:
        """Labels and targets whose hologram was photographed twice: a method with random starts finds another one in
        each repeat. UserError: there are none."""
        same = [
            (label, item)
            for (label, item), own in self.own.items()
            if len(own) > 1 and torch.equal(self.phase(label, item), self.phase(label, item, own[1].repeat))
        ]
        if not same:
            raise UserError(f"{self.study.file}: no hologram is photographed twice; set 'repeats: 2'")
        return same

    def pair(self, label: str, item: str) -> list[Tensor]:
        """Two photographs of one of ``twice``."""
        return [self.captures(cell)[0] for cell in self.own[label, item][:2]]

    def phase(self, label: str, item: str, repeat: int = 0) -> Tensor:
        """A hologram ``(C, H, W)`` [rad] that the study has saved. UserError: it has not."""
        folder = self.output / "phases" / file_name(label) / file_name(self.display.name)
        path = folder / f"{file_name(item)}{f'-{repeat}' * (repeat > 0)}.npy"
        if not path.is_file():
            raise UserError(f"{path}: no such hologram; a twin needs 'save: {{phases: true}}'")
        return torch.from_numpy(read_array(path))

    @cached_property
    def learned(self) -> Artifact:
        """What the row of the twin has learned. UserError: it was not trained."""
        label, artifacts = self.row.label, Artifacts(self.artifacts)
        wanted = next(task.preparation for task in self.plan.tasks if task.label == label and task.preparation)
        if not artifacts.has(wanted):
            lacks = f"has no trained {label}: {artifacts.failure(wanted)}"
            raise UserError(f"{artifacts.folder}: {lacks}; give its --artifacts or --retrain")
        return artifacts.load(wanted)


def of_session(folder: Path) -> Photographed:
    """The study of a session's folder. UserError as ``study_of``, and for photographs that are not taken yet."""
    if not (folder / MANIFEST).is_file():
        own = folder / f"{folder.resolve().name}.yaml"
        hint = f"; the twin there is {own}" * own.is_file()
        raise UserError(f"{folder}: a folder without {MANIFEST}; give that of a session, or a display{hint}")
    try:
        study = study_of(folder, read_manifest(folder), None)
    except UserError as error:
        told = str(error).partition("; give --study")[0]
        raise UserError(f"{told}; a twin is learned from a session of the config 'twin'") from None
    found = Photographed(study, folder / REPORT, folder / ARTIFACTS)
    if any(Store(found.output).read(cell.id) is None for cell in found.plan.cells):
        raise UserError(f"{folder}: photographs are missing; holoeval session import {folder} says which")
    return found


def in_folder(folder: Path, artifacts: Path) -> Photographed:
    """The study of the photographs in the folder of a twin."""
    work = folder / WORK
    return Photographed(load_study(work / f"{PHOTOGRAPHS}.yaml"), work / PHOTOGRAPHS, artifacts)


def refuse(name: str, photographed: Photographed, folder: Path) -> None:
    """UserError, before any photograph, for a display that can have no twin, and where another file has its name."""
    display = photographed.display
    if replace(nominal(name, photographed).spec(), name=display.spec.name) != display.spec:
        raise UserError(f"'{display.name}': a display that is seen through a known lens has no twin")
    if photographed.row.name != "twin":
        predictor(photographed.row.name, photographed.row.params)
    own = folder / f"{file_name(name)}.yaml"
    twin = load(own).data.get("twin") if own.is_file() else {"of": display.name}
    if not isinstance(twin, Mapping) or twin.get("of") != display.name:
        raise UserError(f"{own}: is no twin of '{display.name}'; choose another --output")


def nominal(name: str, photographed: Photographed) -> Profile:
    """What is known of a display before any photograph, as a profile: its nominal panel, and a camera as any."""
    display = photographed.display
    if display.real is not None and display.real.bench is not None:
        bench = load_bench_file(display.real.bench)
        panel, bound = bench.panel, bench.residual_bound
    else:
        profile = load_profile(display.source, display.folder).scaled(display.spec.shape)
        panel, bound = profile.panel, profile.residual_bound
    words = f"The twin of {display.name}, learned from photographs."
    return Profile(name, 1, 0, words, panel=panel, residual_bound=bound)


def write_trial(photographed: Photographed, name: str, folder: Path) -> list[Profile]:
    """Write the twin as a profile, and two that it has to be better than; of a network there are none.

    Of ``turned`` the maps over the panel are turned by half a turn, ``blank`` has no maps. The camera's noise is that
    of two photographs. UserError: the twin cannot be registered.
    """
    for kind, found in zip(("methods", "pictures"), map(set, zip(*photographed.own, strict=True)), strict=True):
        if len(found) < FEWEST:
            raise UserError(f"{photographed.study.file}: {len(found)} {kind}; a twin is tried on {FEWEST} or more")
    trial, row, display = folder / WORK / TRIAL, photographed.row, photographed.display
    base = nominal(name, photographed)
    if row.name != "twin":
        words = f"What {row.name} has learned of {display.name} from photographs; without noise."
        base = replace(base, description=words)
        return [load_profile(str(write_network(photographed.learned.state, row.name, row.params, base, trial)))]
    model, camera = learned_twin(photographed.learned.state, display.spec)
    untried = load_profile(str(to_profile(model, camera, base, trial)))
    base = replace(base, sensor=_camera(photographed, untried))
    twin = load_profile(str(to_profile(model, camera, base, trial)))
    turned = {key: each.flip(-2, -1) if key in OVER_PANEL else each for key, each in _maps(twin).items()}
    others = {"turned": turned, "blank": {}}
    paths = [write_profile(maps, replace(base, name=f"{name}-{key}"), trial) for key, maps in others.items()]
    return [twin, *(load_profile(str(path)) for path in paths)]


def opened(photographed: Photographed, profile: Profile, device: torch.device = CPU) -> CalibratedBench | LearnedBench:
    """A display of the trial."""
    seed = photographed.study.seed
    if profile.network.method:
        return network_bench(profile, seed, device)
    return open_bench(profile, seed=seed, device=device)


def captured(
    photographed: Photographed, bench: CalibratedBench | LearnedBench, label: str, item: str, repeat: int = 0
) -> Tensor:
    """The capture ``(C, h, w)`` of a hologram on a display of the trial. UserError: it cannot be registered, or is
    saturated."""
    try:
        capture = bench.photograph(photographed.phase(label, item), photographed.target(item), item, repeat)
        refuse_saturated(capture)
    except CellError as error:
        raise UserError(f"'{bench.spec.name}': too far from its display to be photographed: {error}") from None
    return capture.image.cpu()


def _maps(profile: Profile) -> dict[str, Tensor]:
    """What its stages hold, by ``maps.KEYS``."""
    return {key: getattr(profile, stage).maps[name] for key in profile.held for stage, name in [key.split(".")]}


def _camera(photographed: Photographed, profile: Profile) -> Sensor:
    """The camera of a profile, whose well and read noise are such that two captures differ as two photographs do."""
    seen = simulated = 0.0
    bench = opened(photographed, profile)
    pictures = list(dict.fromkeys(item for _, item in photographed.twice))[:NOISY]
    for label, item in (pair for pair in photographed.twice if pair[1] in pictures):
        target = photographed.target(item)
        simulated += _difference([captured(photographed, bench, label, item, repeat) for repeat in (0, 1)], target)
        seen += _difference(photographed.pair(label, item), target)
    ratio = simulated / max(seen, 1e-12)
    sensor = profile.sensor
    well, read = sensor.full_well * ratio, sensor.read_noise * math.sqrt(ratio)
    return replace(sensor, full_well=float(f"{well:.4g}"), read_noise=float(f"{read:.4g}"))


def _difference(captures: Sequence[Tensor], target: Tensor) -> float:
    """Mean square of the difference of two captures ``(C, h, w)``, each matched to the target."""
    first, second = (match(capture, target)[0] for capture in captures)
    return float((first - second).square().mean())


def publish(profile: Profile, photographed: Photographed, folder: Path) -> Path:
    """Write the twin with what is known of it; the first of its version, or the next where another was written before.

    profile: of the trial, whose maps or network it has.
    """
    path = folder / f"{file_name(profile.name)}.yaml"
    before = load(path).data if path.is_file() else {}
    version = before["version"] if isinstance(before.get("version"), int) else 0
    for known in (replace(profile, version=max(1, version)), replace(profile, version=version + 1)):
        if known.network.method:
            write_network(photographed.learned.state, known.network.method, known.network.params, known, folder)
        else:
            write_profile(_maps(profile), known, folder)
        if not before or load(path).data == before:
            break
    return path
