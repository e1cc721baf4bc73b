"""A study as written in ``configs/*.yaml``, checked before anything runs: a grid of methods, displays,
targets.

Every mistake in a config is one line that starts with its place, ``configs/table3.yaml:12:5: ...``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, Literal

from annotated_types import Interval, MinLen

from ..core import plugins
from ..core.errors import UserError, suggest
from ..core.plugins import params_of
from ..core.schema import placed, typed
from ..core.yaml_source import Document, Keys, load
from .config_metrics import check_metrics
from .config_sweeps import subset, sweep_of
from .displays import LEARNED, condition, real_condition
from .focal_stacks import planes_of
from .plan import FLOORS, REFERENCE, scored_dataset

PanelSide = Annotated[int, Interval(ge=64, le=8192)]
Text = Annotated[str, MinLen(1)]


@dataclass(frozen=True)
class Learned:
    """A display that is the frozen network of a trained method (paper 6.3), trained on captures of ``profile``."""

    method: Text
    profile: Text
    params: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class DisplayGrid:
    """The displays of a study.

    profiles: names of profiles or paths of profile files; in their place learned: a trained network, or bench: the file
    of a real bench (``lab.bench_file``); panel: rows and columns in pixels (None: the profile's full panel);
    exposure: ``equal`` (the same light for every method) or ``matched`` (equal brightness of the pictures). session:
    the folder that stands for the display, when photographs are exchanged as files.
    """

    profiles: tuple[Text, ...] = ()
    learned: Learned | None = None
    bench: Text | None = None
    panel: tuple[PanelSide, PanelSide] | None = None
    exposure: Literal["equal", "matched"] = "equal"
    session: Path | None = field(default=None, metadata={"key": False})

    @property
    def sources(self) -> tuple[str, ...]:
        """The displays by the names they have in a config."""
        return (LEARNED,) if self.learned else (self.bench,) if self.bench else self.profiles

    @property
    def real(self) -> bool:
        """Whether the display exists."""
        return self.bench is not None or self.session is not None


@dataclass(frozen=True)
class Targets:
    """The images that are scored: a registered dataset and its parameters."""

    dataset: Text
    params: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Training:
    """The images that methods may train on, never scored; equal for all methods of a study.

    held_out: how many of the last images are kept back to watch the training; captures: the most captures that a
    method may take for its training, those of held-out images included (None: no limit).
    """

    dataset: Text = "dead_leaves"
    params: Mapping[str, Any] = field(default_factory=dict)
    held_out: Annotated[int, Interval(ge=1, le=1000)] = 4
    captures: Annotated[int, Interval(ge=1)] | None = None


@dataclass(frozen=True)
class Probe:
    """The method whose holograms are shown when predictions of captures are scored (paper Table 1)."""

    name: Text = "wirtinger"
    params: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Sweep:
    """A change of the displays at test time, by one value after another; methods were prepared without it.

    condition: its kind, see ``display.simulated.changes``; values: numbers, or names; count: so many siblings or draws
    in their place; profiles: the displays that are changed, a subset of the study's.
    """

    condition: Text
    values: tuple[float | Text, ...] = ()
    count: Annotated[int, Interval(ge=1, le=10_000)] | None = None
    profiles: tuple[str, ...] = ()


@dataclass(frozen=True)
class MethodEntry:
    """A method of a study.

    name: registered name or ``path/to/file.py:Class``; label: its name in tables; params: every parameter of
    the method, defaults filled in; profiles: the displays it is shown on, a subset of the study's; captures: the most
    that the display allows a method with a camera for one target (None: no limit).
    """

    name: Text
    label: str = ""
    params: Mapping[str, Any] = field(default_factory=dict)
    profiles: tuple[str, ...] = ()
    captures: Annotated[int, Interval(ge=1)] | None = None


@dataclass(frozen=True)
class Protocol:
    """Version of the metric protocol; names of the metrics to compute (None: all; they take 10 s for a capture of
    1080 x 1920 pixels); a file or folder of LPIPS trunk weights (None: torch's hub cache)."""

    version: Literal["v1"] = "v1"
    metrics: tuple[Text, ...] | None = None
    lpips_weights: Text | None = None


@dataclass(frozen=True)
class Save:
    """What else is written beside the scores: rectified captures (16 bit) and phases (8 bit)."""

    captures: bool = False
    phases: bool = False


@dataclass(frozen=True)
class Reported:
    """Published figures to print beside the measured ones, by method label, and where they were published.

    beside: the profile whose rows they stand beside, as ``display.profiles`` names it; none: every profile's.
    """

    source: Text
    rows: Mapping[str, Mapping[str, float]]
    beside: Text | None = None


@dataclass(frozen=True)
class Study:
    """A grid of cells and the tables drawn from it; see ``load_study``.

    measure: ``picture`` scores captures against targets; ``prediction`` scores what trained methods predict of the
    captures of ``holograms`` against those captures; ``focus`` scores the planes of focal stacks, each at its own
    distance. note: a paragraph that the report prints beside its tables.
    repeats: how often every cell is measured, with new noise; timing: ``shared`` takes a solution's seconds beside
    whatever other workers do, ``alone`` measures one solution a row of the tables with nothing beside it; sweeps:
    changes of the displays at test time; baseline: label that paired tests compare against (the first method when the
    config names none); headline: the column the report leads with.
    file, text: the config file as the user named it, and what is in it.
    """

    title: Text
    display: DisplayGrid
    targets: Targets
    methods: Annotated[tuple[MethodEntry, ...], MinLen(1)]
    measure: Literal["picture", "prediction", "focus"] = "picture"
    holograms: Probe = Probe()
    training: Training = Training()
    sweeps: tuple[Sweep, ...] = ()
    note: str = ""
    seed: Annotated[int, Interval(ge=0, le=2**63 - 1)] = 0
    repeats: Annotated[int, Interval(ge=1, le=1000)] = 1
    timing: Literal["shared", "alone"] = "shared"
    protocol: Protocol = Protocol()
    baseline: str = ""
    headline: Text = "psnr_linear"
    save: Save = Save()
    reported: Reported | None = None
    file: Path = field(default=Path(), metadata={"key": False})
    text: str = field(default="", metadata={"key": False})

    @property
    def folder(self) -> Path:
        """The config's folder; relative paths in a config start here."""
        return self.file.parent

    @property
    def name(self) -> str:
        """The config's file name without its ending; the default name of the output folder."""
        return self.file.stem

    @property
    def labels(self) -> tuple[str, ...]:
        """Labels of the methods, in the order of the config."""
        return tuple(entry.label for entry in self.methods)


def load_study(path: Path | str) -> Study:
    """Read and check a study completely; every fault is a UserError that starts with file:line:column."""
    document = load(Path(path))
    study = replace(typed(document, Study, _long_form(document.data)), file=Path(path), text=document.text)
    study = replace(study, targets=_targets(study, document), protocol=_protocol(study, document))
    study = replace(study, training=_training(study, document), holograms=_holograms(study, document))
    study = replace(study, display=_display(study, document))
    _check_profiles(study, document)
    study = replace(study, sweeps=tuple(sweep_of(study, document, index) for index in range(len(study.sweeps))))
    entries = tuple(_entry(study, document, index) for index in range(len(study.methods)))
    study = replace(study, methods=entries)
    _check_labels(study, document)
    _check_twins(study, document)
    check_metrics(study, document)
    if study.reported and study.reported.beside not in (None, *study.display.sources):
        near = suggest(str(study.reported.beside), study.display.sources)
        message = f"'{study.reported.beside}' is not in display.profiles; {near}"
        raise document.error(("reported", "beside"), message)
    if study.baseline and study.baseline not in study.labels:
        message = f"no method has the label '{study.baseline}'; {suggest(study.baseline, study.labels)}"
        raise document.error(("baseline",), message)
    return replace(study, baseline=study.baseline or study.labels[0])


def _long_form(data: Mapping[str, Any]) -> dict[str, Any]:
    """A config with every method as a mapping; one without parameters may be given by its name alone."""
    methods = data.get("methods")
    if not isinstance(methods, list):
        return dict(data)
    return {**data, "methods": [{"name": item} if isinstance(item, str) else item for item in methods]}


def _targets(study: Study, document: Document) -> Targets:
    with placed(document, ("targets", "dataset"), ("targets", "params")):
        dataset = scored_dataset(study)
        if not dataset.items():
            raise UserError(f"dataset '{study.targets.dataset}' has no images")
        if study.measure == "focus":
            planes_of(dataset, study.targets.dataset)
    return replace(study.targets, params=params_of(dataset))


def _training(study: Study, document: Document) -> Training:
    chosen = study.training
    with placed(document, ("training", "dataset"), ("training", "params")):
        dataset = plugins.build("datasets", chosen.dataset, dict(chosen.params), study.folder)
        count = len(dataset.items())
        if chosen.held_out >= count:
            raise UserError(f"training.held_out {chosen.held_out} leaves nothing of {count} images to train on")
    return replace(chosen, params=params_of(dataset))


def _holograms(study: Study, document: Document) -> Probe:
    chosen = study.holograms
    with placed(document, ("holograms", "name"), ("holograms", "params")):
        method = plugins.build("methods", chosen.name, dict(chosen.params), study.folder)
        if getattr(method, "trains", False):
            raise UserError(f"method '{chosen.name}' has to be trained; holograms should be of one that learns nothing")
    return replace(chosen, params=params_of(method))


def _display(study: Study, document: Document) -> DisplayGrid:
    display = study.display
    named = [name for name in ("profiles", "learned", "bench") if getattr(display, name)]
    if len(named) != 1:
        where: Keys = ("display", named[-1] if named else "profiles")
        message = "display.profiles, display.learned or display.bench: name displays in one of the three"
        raise document.error(where, message)
    if display.bench:
        return _bench(study, document)
    if display.learned is None:
        return display
    if study.measure != "picture":
        raise document.error(("measure",), "a learned display is a prediction already; measure its pictures")
    where = ("display", "learned")
    with placed(document, (*where, "method"), (*where, "params")):
        method = plugins.build("methods", display.learned.method, dict(display.learned.params), study.folder)
        if not (getattr(method, "trains", False) and hasattr(method, "predict")):
            raise UserError(f"method '{display.learned.method}' learns no display; name one that predicts captures")
    return replace(display, learned=replace(display.learned, params=params_of(method)))


def _bench(study: Study, document: Document) -> DisplayGrid:
    if study.display.panel is not None:
        raise document.error(("display", "panel"), "a bench has the panel that its file says; remove 'panel'")
    if study.measure == "focus":
        raise document.error(("measure",), "focal stacks need a camera that refocuses; measure pictures or predictions")
    return study.display


def _protocol(study: Study, document: Document) -> Protocol:
    from ..metrics.lpips import find_weights

    given = study.protocol.lpips_weights
    if given is None:
        return study.protocol
    weights = (study.folder / Path(given).expanduser()).resolve()
    where: Keys = ("protocol", "lpips_weights")
    with placed(document, where, where):
        if not (find_weights("alex", weights) or find_weights("vgg", weights)):
            raise UserError(f"no alexnet-*.pth or vgg16-*.pth in {weights}")
    return replace(study.protocol, lpips_weights=str(weights))


def _check_profiles(study: Study, document: Document) -> None:
    from ..imaging.grid import SMALLEST_REGION

    seen: dict[str, str] = {}
    learned = study.display.learned
    bench = study.display.bench
    for index, profile in enumerate([learned.profile] if learned else study.display.sources):
        where: Keys = ("display", "learned", "profile") if learned else ("display", "profiles", index)
        where = ("display", "bench") if bench else where
        with placed(document, where, where):
            read = real_condition(bench, study.folder) if bench else None
            place = read or condition(profile, study.display.panel, study.folder)
        name, region = place.name, place.spec.region.shape
        if min(region) < SMALLEST_REGION:
            message = f"'{name}' scores a window of {region[0]} x {region[1]} pixels of this panel"
            raise document.error(("display", "panel"), f"{message}; registration needs at least {SMALLEST_REGION}")
        if name in seen:
            raise document.error(
                where, f"'{profile}' and '{seen[name]}' are both named '{name}'; list each display once"
            )
        if name == REFERENCE:
            raise document.error(where, f"a profile may not be named '{REFERENCE}': the floor rows have that name")
        seen[name] = profile


def _entry(study: Study, document: Document, index: int) -> MethodEntry:
    entry, where = study.methods[index], ("methods", index)
    with placed(document, (*where, "name"), (*where, "params")):
        method = plugins.build("methods", entry.name, dict(entry.params), study.folder)
        if study.measure == "prediction" and not hasattr(method, "predict"):
            raise UserError(f"method '{entry.name}' predicts no captures; measure: prediction needs methods that do")
    if study.display.real and getattr(method, "privileged", False):
        message = f"'{entry.name}' looks into a simulated bench; remove it from a study on a real one"
        raise document.error((*where, "name") if (*where, "name") in document.keys else where, message)
    if entry.captures is not None and (not getattr(method, "camera", False) or study.measure == "prediction"):
        message = f"'{entry.name}' takes no captures of a target here; remove 'captures'"
        raise document.error((*where, "captures"), message)
    profiles = subset(study, document, entry.profiles, (*where, "profiles"))
    label = entry.label or entry.name.rpartition(":")[2]
    return replace(entry, label=label, params=params_of(method), profiles=profiles)


def _check_labels(study: Study, document: Document) -> None:
    for index, label in enumerate(study.labels):
        where: Keys = ("methods", index, "label")
        if label in study.labels[:index]:
            other = study.labels.index(label)
            raise document.error(
                where, f"methods[{index}] and methods[{other}] share the label '{label}'; give one a 'label'"
            )
        if not label.isprintable() or len(label) > 60 or label in FLOORS:
            raise document.error(where, f"label {label!r} should be printable, at most 60 characters and not a floor's")
    for label in study.reported.rows if study.reported else ():
        if label not in study.labels:
            message = f"no method has the label '{label}'; {suggest(label, study.labels)}"
            raise document.error(("reported", "rows", label), message, at_key=True)


def _check_twins(study: Study, document: Document) -> None:
    """Two labels for one and the same cell would be one measurement printed as two."""
    for index, entry in enumerate(study.methods):
        for other in study.methods[:index]:
            same = (entry.name, entry.params, entry.captures) == (other.name, other.params, other.captures)
            if same and set(entry.profiles) & set(other.profiles):
                message = f"methods[{index}] has the method, parameters and display of '{other.label}'; remove one"
                raise document.error(("methods", index), message)
