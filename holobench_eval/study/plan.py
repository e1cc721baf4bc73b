"""The grid of cells of a study: every number and how it is measured. Nothing is computed or written here."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from ..core.errors import UserError
from ..core.hashing import digest
from ..display.api import Exposure
from ..metrics import catalogue
from . import isolation
from .definition import Measure, MethodEntry, Study
from .displays import Condition, Preparation, changed, displays, preparation
from .focal_stacks import VERSION as IN_FOCUS
from .focal_stacks import Showing, Target, planes_a_scene, planes_of, showings
from .isolation import read_files
from .versions import HARNESS, PHOTOGRAPHS, method_version

REFERENCE = "reference"  # the condition of the floor cells
Maker = tuple[str, str, Mapping[str, Any]]  # method, its version, parameters
FLOORS = (  # what a study without any display would score: see ``holobench_eval.metrics.references``
    "floor_constant",
    "floor_black",
    "floor_speckle",
    "floor_wrong_target",
    "floor_mirrored",
    "floor_shift_1px",
)


@dataclass(frozen=True)
class Cell:
    """The plain description of a measurement; its hash names the record.

    method: registered name or ``file.py:Class``; method_sha256: its version (``versions.method_version``); params:
    all of them; target_sha256: digest of the source image; profile_version, profile_sha256: of the display;
    panel: rows and columns in pixels; condition: name of the display, or ``reference`` for the floor;
    repeat, seed: names of the noise; harness_sha256: version of optics, bench, registration and metrics
    (``versions.HARNESS``); metrics: name and version of every metric that can be computed here; measure: what
    is scored, see ``Study``; holograms: whose captures are predicted (empty for pictures);
    prepared: what the method and the display had to learn first (``Preparation.id``, empty for nothing); captures:
    the most that the display allows while the target is solved (None: no limit); change: kind and value of what has
    changed on the display since methods were prepared for it (empty: nothing); files: digests of the files that the
    method reads for the target, by their paths (empty: it reads none); session: name of the series of photographs
    that stands for the display (empty: none does); starts: ids of the cells of other methods whose phases the
    method starts from (empty: it follows nobody).
    """

    method: str
    method_sha256: str
    params: Mapping[str, Any]
    dataset: str
    dataset_params: Mapping[str, Any]
    target: str
    target_sha256: str
    profile: str
    profile_version: int
    profile_sha256: str
    panel: tuple[int, int]
    condition: str
    repeat: int
    seed: int
    protocol: str
    harness_sha256: str
    metrics: tuple[str, ...]
    exposure: Exposure
    measure: Measure = "picture"
    holograms: Mapping[str, Any] = field(default_factory=dict)
    prepared: tuple[str, ...] = ()
    captures: int | None = None
    change: Mapping[str, Any] = field(default_factory=dict)
    files: Mapping[str, str] = field(default_factory=dict)
    session: str = ""
    starts: tuple[str, ...] = ()

    def description(self) -> dict[str, Any]:
        """The cell as plain JSON values, without ``captures`` if there is no limit, and without an empty ``change``,
        ``files``, ``session`` or ``starts``."""
        plain: dict[str, Any] = {item.name: getattr(self, item.name) for item in fields(self)}
        plain |= {name: list(plain[name]) for name in ("panel", "metrics", "prepared", "starts")}
        plain |= {name: dict(plain[name]) for name in ("params", "dataset_params", "holograms", "change", "files")}
        if self.captures is None:
            del plain["captures"]
        for name in ("change", "files", "session", "starts"):
            if not plain[name]:
                del plain[name]
        return plain

    @cached_property
    def id(self) -> str:
        """sha256 of the description: the name of the record."""
        return digest(self.description())


@dataclass(frozen=True)
class Task:
    """Cells that share a solution: a method solves a target once, and the phase is shown on each of the displays.

    conditions: the display of each cell; the method solves on the first. A floor task has no
    solution and one display, which gives the size of the scored region. preparation: what the method learns first;
    is_start: whether another task starts from its phase, which is then kept.
    """

    label: str
    cells: tuple[Cell, ...]
    conditions: tuple[Condition, ...]
    preparation: Preparation | None = None
    is_start: bool = False

    @property
    def is_floor(self) -> bool:
        """Whether the cells are floor cells, which have no method."""
        return self.cells[0].condition == REFERENCE


@dataclass(frozen=True)
class Plan:
    """Every task of a study, in the order in which they are run and reported."""

    tasks: tuple[Task, ...]

    def labelled(self) -> Iterator[tuple[str, Cell]]:
        """(label in tables, cell) of every cell; the label of a floor cell is its method."""
        for task in self.tasks:
            for cell in task.cells:
                yield (cell.method if task.is_floor else task.label), cell

    @property
    def cells(self) -> tuple[Cell, ...]:
        """Every cell."""
        return tuple(cell for task in self.tasks for cell in task.cells)

    @property
    def floors(self) -> int:
        """The number of floor cells, which no method makes."""
        return sum(len(task.cells) for task in self.tasks if task.is_floor)

    def preparations(self) -> dict[str, Preparation]:
        """Everything that has to be learned before the cells can be computed, by its id."""
        trainings = [task.preparation for task in self.tasks]
        trainings += [display.learned for task in self.tasks for display in task.conditions]
        return {training.id: training for training in trainings if training is not None}


def plan(study: Study) -> Plan:
    """The grid of a study: every number of its tables, and how it is measured.

    Parameters
    ----------
    study
        A checked study, see ``config.load_study``.

    Returns
    -------
    Plan
        Tasks in the order in which they are run and reported. Profiles and digests of target images are read;
        nothing is computed.

    Raises
    ------
    UserError
        An image that a method trains on is scored, too.

    Examples
    --------
    >>> from holobench_eval.study.config import load_study
    >>> grid = plan(load_study("configs/quick.yaml"))
    >>> len(grid.tasks), len(grid.cells)
    (10, 20)
    """
    targets = [(item, study.dataset.digest(item)) for item in study.items]
    displays_by_source = displays(study)
    ground = _Ground(study, _metrics(study))
    first = next(iter(displays_by_source.values()))
    apart = planes_a_scene(ground.planes) if study.measure == "focus" else 1
    tasks = [ground.floor(first, target, targets[(i + apart) % len(targets)]) for i, target in enumerate(targets)]
    for entry in study.methods:
        entry_displays = [
            display for source in entry.profiles for display in changed(study, source, displays_by_source[source])
        ]
        tasks += ground.solutions(entry, entry_displays, targets)
    grid = Plan(tuple(following(tasks, study.folder)))
    check_unseen(grid.preparations(), targets)
    return grid


@dataclass(frozen=True)
class _Ground:
    """What all cells of a study have in common."""

    study: Study
    metrics: tuple[str, ...]

    @cached_property
    def planes(self) -> dict[str, tuple[str, float]]:
        """Scene and plane [mm] of every target of focal stacks."""
        return planes_of(self.study.dataset, self.study.targets.dataset)

    @cached_property
    def probe_sha256(self) -> str:
        """The version of the method whose captures are predicted."""
        return method_version(isolation.find(self.study.holograms.name, self.study.folder))

    def cell(
        self,
        target: Target,
        display: Condition,
        condition: str,
        repeat: int,
        maker: Maker,
        prepared: tuple[str, ...] = (),
        captures: int | None = None,
        exposure: Exposure | None = None,
        files: Mapping[str, str] | None = None,
    ) -> Cell:
        """A cell; ``target``: name and digest; ``maker``: the method that makes the picture; exposure: None for the
        study's; files: digests of those that the method reads."""
        study = self.study
        method, version, params = maker
        is_real = display.real is not None and condition != REFERENCE
        holograms = study.holograms
        probe = {"name": holograms.name, "params": holograms.params, "sha256": self.probe_sha256}
        return Cell(
            method=method,
            method_sha256=version,
            params=params,
            dataset=study.targets.dataset,
            dataset_params=study.targets.params,
            target=target[0],
            target_sha256=target[1],
            profile=display.name,
            profile_version=display.version,
            profile_sha256=display.digest,
            panel=display.spec.shape,
            condition=condition,
            repeat=repeat,
            seed=study.seed,
            protocol=study.protocol.version,
            harness_sha256=f"{HARNESS}; {PHOTOGRAPHS}" if is_real else HARNESS,
            metrics=self.metrics,
            exposure=exposure or study.display.exposure,
            measure=study.measure,
            holograms=probe if study.predicts else {},
            prepared=prepared,
            captures=captures,
            files=files or {},
            change=dict([display.change]) if display.change and condition != REFERENCE else {},
            session=display.real.session if display.real and condition != REFERENCE else "",
        )

    def solutions(self, entry: MethodEntry, entry_displays: list[Condition], targets: list[Target]) -> Iterator[Task]:
        """A task for every solution of a method: target by target, repeat by repeat."""
        cls = isolation.find(entry.name, self.study.folder)
        maker = (entry.name, method_version(cls), entry.params)
        read = read_files.of(entry, self.study.folder, cls, (name for name, _ in targets))
        for showing in self._showings(cls, entry_displays, targets):
            conditions = tuple(display for _, display in showing)
            own = preparation(self.study, entry.name, entry.params, conditions[0].nominal)
            for repeat in range(self.study.repeats):
                cells = (
                    self.cell(
                        target,
                        display,
                        self._condition(display),
                        repeat,
                        maker,
                        _ids(own, display.learned),
                        entry.captures,
                        entry.exposure,
                        read[target[0]],
                    )
                    for target, display in showing
                )
                yield Task(entry.label, tuple(cells), conditions, own)

    def _showings(self, cls: type[Any], entry_displays: list[Condition], targets: list[Target]) -> Iterator[Showing]:
        """The targets and displays of each solution."""
        measure = self.study.measure
        for group in (
            [(display,) for display in entry_displays] if self.study.predicts else _sharing(cls, entry_displays)
        ):
            if measure == "focus":
                yield from showings(cls, group, targets, self.planes)
            else:
                yield from ([(target, display) for display in group] for target in targets)

    def _condition(self, display: Condition) -> str:
        """The name of a display in tables; the planes of a focal stack share a row."""
        return display.name if self.study.measure == "focus" else display.title

    def floor(self, display: Condition, target: Target, wrong: Target) -> Task:
        """The references of a target; ``wrong``: the target whose picture is scored as the wrong one."""
        wrong_target = {"target": wrong[0], "target_sha256": wrong[1]}
        params = {name: wrong_target if name == "floor_wrong_target" else {} for name in FLOORS}
        if wrong == target:
            del params["floor_wrong_target"]
        cells = tuple(
            self.cell(target, display, REFERENCE, 0, (name, "", cell_params), _ids(display.learned))
            for name, cell_params in params.items()
        )
        return Task("floor", cells, (display,) * len(cells))


def _ids(*trainings: Preparation | None) -> tuple[str, ...]:
    return tuple(training.id for training in trainings if training is not None)


def _metrics(study: Study) -> tuple[str, ...]:
    """Name and version of the study's metrics.

    A study that names none gets all that can be computed here, and the headline's: weights of LPIPS may come later.
    """
    weights, wanted = study.protocol.lpips_weights, study.protocol.metrics
    metrics = catalogue(None if weights is None else Path(weights))
    if wanted is None:
        wanted = tuple(
            metric.name for metric in metrics if metric.available() is None or study.headline in metric.columns
        )
    computed = [metric for metric in metrics if metric.name in wanted]
    names = [f"{metric.name} {metric.version}" for metric in computed]
    names += ["speckle_contrast"] if "speckle_contrast" in wanted else []
    return (*names, IN_FOCUS) if study.measure == "focus" else tuple(names)


def _sharing(cls: type[Any], entry_displays: list[Condition]) -> list[tuple[Condition, ...]]:
    """Displays grouped so that the displays of a group share a solution.

    A method that neither captures nor trains nor is privileged knows only the nominal optics, so displays with equal
    nominal optics get the same phase. A trained method knows the display before any change. A method that captures or
    is privileged solves on each display as it is.
    """
    if any(getattr(cls, property, False) for property in ("camera", "privileged")):
        return [(display,) for display in entry_displays]
    trains, groups = getattr(cls, "trains", False), dict[Any, list[Condition]]()
    for display in entry_displays:
        groups.setdefault((display.name, display.spec) if trains else replace(display.spec, name=""), []).append(
            display
        )
    return [tuple(group) for group in groups.values()]


def following(tasks: Sequence[Task], folder: Path) -> Iterator[Task]:
    """The same tasks, with the ``starts`` of methods that follow others (``follows = True``): the cells of all others
    for the same target on the same display in the same repeat, sorted, so that their order in the config is no matter.

    folder: of the config.
    """

    def follows(task: Task) -> bool:
        return not task.is_floor and bool(getattr(isolation.find(task.cells[0].method, folder), "follows", False))

    followers = [follows(task) for task in tasks]
    if not any(followers):
        yield from tasks
        return
    others: dict[tuple[str, str, int], list[str]] = {}
    for task, late in zip(tasks, followers, strict=True):
        for cell in () if late or task.is_floor else task.cells:
            others.setdefault((cell.target, cell.condition, cell.repeat), []).append(cell.id)

    def starts(cell: Cell) -> tuple[str, ...]:
        return tuple(sorted(others.get((cell.target, cell.condition, cell.repeat), ())))

    late_tasks = {
        index: replace(task, cells=tuple(replace(cell, starts=starts(cell)) for cell in task.cells))
        for index, (task, late) in enumerate(zip(tasks, followers, strict=True))
        if late
    }
    wanted = {identity for task in late_tasks.values() for cell in task.cells for identity in cell.starts}
    for index, task in enumerate(tasks):
        if index in late_tasks:
            yield late_tasks[index]
        else:
            yield replace(task, is_start=not wanted.isdisjoint(cell.id for cell in task.cells))


def check_unseen(preparations: Mapping[str, Preparation], targets: list[tuple[str, str]]) -> None:
    """Refuse a study that scores an image it trains on. targets: name and digest of each. UserError names the image."""
    scored = {sha256: name for name, sha256 in targets}
    for training in preparations.values():
        for item, sha256 in training.images:
            if sha256 in scored:
                raise UserError(f"training image '{item}' is the scored target '{scored[sha256]}'; train on others")
