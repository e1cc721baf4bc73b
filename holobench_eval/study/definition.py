"""A study as its config describes it: a grid of methods, displays and targets; see ``config`` for the checks."""

from __future__ import annotations

import itertools
import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal

from annotated_types import Interval, MinLen

from ..core import plugins
from ..core.errors import UserError
from ..datasets.base import digest_of
from ..display.api import Exposure
from .changes import Changes

LEARNED = "learned"  # a config's name for the display that is a trained network
PanelSide = Annotated[int, Interval(ge=64, le=8192)]
Text = Annotated[str, MinLen(1)]
Measure = Literal["picture", "prediction", "error_budget", "focus", "views"]
Isolation = Literal["files", "process", "none"]  # whose methods run in processes of their own
PREDICTIONS = ("prediction", "error_budget")  # measures of captures that methods predict
STACKS = {"focus": "refocuses", "views": "has an eye's pupil"}
"""Measures whose targets are planes or views of scenes, and belong together; what the camera does for them."""


@dataclass(frozen=True)
class Learned:
    """A display that is the frozen network of a trained method (paper 6.3).

    method: which one; profile: the display whose captures it is trained on; params: parameters of the method.
    """

    method: Text
    profile: Text
    params: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class DisplayGrid:
    """The displays of a study.

    A study names its displays by one of profiles, learned and bench.

    profiles: names of profiles or paths of profile files; learned: a trained network in the place of a display; bench:
    the file of a real bench (docs/real-bench.md); panel: rows and columns in pixels, at most those of the profile
    (None: all of them); exposure: ``equal`` (the same light for every method) or ``matched`` (equal brightness of the
    pictures); session: the folder that stands for the display, when photographs are exchanged as files.
    """

    profiles: tuple[Text, ...] = ()
    learned: Learned | None = None
    bench: Text | None = None
    panel: tuple[PanelSide, PanelSide] | None = None
    exposure: Exposure = "equal"
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
    """The images that are scored.

    dataset: which one; params: its parameters, whose paths start in the working directory; only: some of its images
    (none: all).
    """

    dataset: Text
    params: Mapping[str, Any] = field(default_factory=dict)
    only: tuple[str, ...] = field(default=(), metadata={"key": False})


@dataclass(frozen=True)
class Training:
    """The images that methods may train on, never scored; equal for all methods of a study.

    dataset: which one; params: its parameters; held_out: how many of the last images are kept back to watch the
    training; captures: the most that a method may take for its training, those of held-out images included (None: no
    limit).
    """

    dataset: Text = "dead_leaves"
    params: Mapping[str, Any] = field(default_factory=dict)
    held_out: Annotated[int, Interval(ge=1, le=1000)] = 4
    captures: Annotated[int, Interval(ge=1)] | None = None


@dataclass(frozen=True)
class Probe:
    """The method whose holograms are shown when predictions of captures are scored (paper Table 1).

    name: which one; params: its parameters.
    """

    name: Text = "wirtinger"
    params: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Claim:
    """What was published of a change of the display, which the report judges for the first method of the question.

    says: in words; until: for values up to this, in size (None: for all).
    """

    says: Text
    until: float | None = None


@dataclass(frozen=True)
class Sweep:
    """A change of the displays at test time, with a list of values; methods were prepared without it.

    condition: its kind (``holoeval list conditions``); values: numbers or names; count: how many siblings or draws
    to take instead of values; profiles: the displays that are changed, a subset of the study's; claim: what was
    published of such a change.
    """

    condition: Text
    values: tuple[float | Text, ...] = ()
    count: Annotated[int, Interval(ge=1, le=10_000)] | None = None
    profiles: tuple[str, ...] = ()
    claim: Claim | None = None


@dataclass(frozen=True)
class MethodEntry:
    """A method of a study.

    name: which one; label: its name in tables (empty: its name, or that of its
    class); params: parameters of the method; grid: lists of values of further parameters, for a row with each
    combination; profiles: the displays it is shown on, a subset of the study's; captures: the most that the display
    allows a method with a camera for one target (None: no limit); exposure: of its scored captures (None: that of the
    display); row: its place in the config, from 0.
    """

    name: Text
    label: str = ""
    params: Mapping[str, Any] = field(default_factory=dict)
    grid: Mapping[str, Annotated[tuple[Any, ...], MinLen(1)]] = field(default_factory=dict)
    profiles: tuple[str, ...] = ()
    captures: Annotated[int, Interval(ge=1)] | None = None
    exposure: Exposure | None = None
    row: int = field(default=0, metadata={"key": False})

    def combinations(self) -> Iterator[MethodEntry]:
        """An entry for each combination of the grid's values, with its label; without a grid this one alone."""
        for values in itertools.product(*self.grid.values()):
            chosen = dict(zip(self.grid, values, strict=True))
            texts = [value if isinstance(value, str) else json.dumps(value) for value in values]
            parts = [f"{name.replace('_', ' ')} {text}" for name, text in zip(chosen, texts, strict=True)]
            label = ", ".join([self.label or self.name.rpartition(":")[2], *parts])
            yield replace(self, label=label, params={**self.params, **chosen}, grid={})


@dataclass(frozen=True)
class Protocol:
    """How captures are scored.

    version: of the metric protocol; metrics: names of the metrics to compute (None: all but ``control``, which is one
    of predictions and takes four more captures of each target); lpips_weights: a file or folder of LPIPS trunk weights
    (None: torch's hub cache).
    """

    version: Literal["v2"] = "v2"
    metrics: tuple[Text, ...] | None = None
    lpips_weights: Text | None = None


@dataclass(frozen=True)
class Save:
    """What else is written beside the scores.

    kept: registered captures, exact, among the records, for ``holoeval rescore``; captures: the same as PNG of 16 bits,
    in a folder beside the report, by name; phases: holograms there (PNG of 8 bits, and exact as .npy, which the method
    ``phases`` reads).
    """

    kept: bool = True
    captures: bool = False
    phases: bool = False


@dataclass(frozen=True)
class Limits:
    """What the process of a method may take for a cell.

    seconds: time, captures included; memory_gib: memory above that of the libraries [GiB], none for all there is.
    """

    seconds: Annotated[float, Interval(gt=0)] = 14400.0
    memory_gib: Annotated[float, Interval(gt=0)] | None = None


@dataclass(frozen=True)
class Reported:
    """Published figures to print beside the measured ones.

    source: where they were published; rows: by a method's label, figures by the name of the metric, such as psnr;
    beside: the profile whose rows they stand beside, as ``display.profiles`` names it; none: every profile's.
    """

    source: Text
    rows: Mapping[str, Mapping[str, float]]
    beside: Text | None = None


@dataclass(frozen=True)
class Study:
    """A grid of cells and the tables drawn from it; see ``load_study``.

    title: heads the report; display: what shows the holograms; targets: the images that are scored; methods: what is
    compared, each a name or a mapping, in the order of the tables.
    measure: ``picture`` scores captures; ``prediction`` what trained methods predict of captures; ``error_budget`` also
    splits the error of these captures by method; ``focus`` scores the planes of focal stacks, ``views`` the views of
    light fields. holograms: for predictions, the method whose holograms are captured; training: the images that methods
    may train on; sweeps: changes of the displays at test time.
    question: what the report answers first, for the methods whose labels it names; would_change: which result would
    change the answer; note: a paragraph among the limits of the answer.
    seed: of all random numbers; repeats: how often every cell is measured, with new noise; timing: ``shared`` takes
    seconds beside other workers, ``alone`` those of one solution a row with nothing beside it; protocol: how captures
    are scored; baseline: label that paired tests compare against (empty: the first method's); headline: the column that
    the report leads with, a metric and a domain; save: what else is written beside the scores.
    isolation: ``files`` runs methods that do not ship with the package in processes of their own, ``process`` all but
    those that look into the bench, ``none`` no method; limits: what such a process may take for a cell; reported:
    published figures to print beside the measured ones; board: whether its cards come first on a site; parts: further
    studies by name, each with the keys that differ from those of this one (null: without the key); their reports lie in
    its folder.
    file, text: the config file as the user named it, and the keys in it; part: its name, where it is a part of another
    study; changes: those of the command line.
    """

    title: Text
    display: DisplayGrid
    targets: Targets
    methods: Annotated[tuple[MethodEntry, ...], MinLen(1)]
    measure: Measure = "picture"
    holograms: Probe = Probe()
    training: Training = Training()
    sweeps: tuple[Sweep, ...] = ()
    question: str = ""
    would_change: str = ""
    note: str = ""
    seed: Annotated[int, Interval(ge=0, le=2**63 - 1)] = 0
    repeats: Annotated[int, Interval(ge=1, le=1000)] = 1
    timing: Literal["shared", "alone"] = "shared"
    protocol: Protocol = Protocol()
    baseline: str = ""
    headline: Text = "psnr_linear"
    save: Save = Save()
    isolation: Isolation = "files"
    limits: Limits = Limits()
    reported: Reported | None = None
    board: bool = False
    parts: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    file: Path = field(default=Path(), metadata={"key": False})
    part: str = field(default="", metadata={"key": False})
    text: str = field(default="", metadata={"key": False})
    changes: Changes = field(default=Changes(), metadata={"key": False})

    @property
    def folder(self) -> Path:
        """The config's folder; relative paths in a config start here."""
        return self.file.parent

    @property
    def config(self) -> Path:
        """The study as a command has it: the config's file, and the part behind it."""
        return self.file / self.part

    @property
    def name(self) -> str:
        """The config's file name without its ending, and the part behind it; the default name of the output folder."""
        return Path(self.file.stem, self.part).as_posix()

    @cached_property
    def dataset(self) -> Any:
        """The dataset whose images are scored. UserError for one that methods may train on."""
        name = self.targets.dataset
        dataset = plugins.build("datasets", name, dict(self.targets.params), self.folder)
        try:
            dataset.items()
        except UserError:
            raise
        except Exception as error:  # a stranger's dataset
            raise UserError(f"dataset '{name}' cannot list its items: {type(error).__name__}: {error}") from error
        if getattr(dataset, "training", False):
            raise UserError(f"dataset '{name}' holds training images, which are never scored; choose another one")
        return dataset

    @property
    def items(self) -> tuple[str, ...]:
        """Names of the images that are scored, in the order of the dataset."""
        return self.targets.only or tuple(self.dataset.items())

    @cached_property
    def training_images(self) -> tuple[tuple[str, str], ...]:
        """Name and digest of every image that methods may train on."""
        training = self.training
        dataset = plugins.build("datasets", training.dataset, dict(training.params), self.folder)
        return tuple((item, digest_of(dataset, item)) for item in dataset.items())

    @property
    def predicts(self) -> bool:
        """Whether its methods predict captures of the holograms of another one."""
        return self.measure in PREDICTIONS

    @property
    def labels(self) -> tuple[str, ...]:
        """Labels of the methods, in the order of the config."""
        return tuple(entry.label for entry in self.methods)

    def with_methods(self, methods: Iterable[MethodEntry]) -> Study:
        """The study with some of its methods; what it says of the others goes with them."""
        kept = tuple(methods)
        gone = {*self.labels} - {entry.label for entry in kept}
        baseline = "" if self.baseline in gone else self.baseline
        rows = self.reported.rows if self.reported else {}
        rows = {label: row for label, row in rows.items() if label not in gone}
        reported = self.reported and replace(self.reported, rows=rows)
        return replace(self, methods=kept, baseline=baseline, reported=reported)
