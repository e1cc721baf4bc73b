"""The grid of cells of a study: every number and how it is measured. Nothing is computed or written here."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from ..core.errors import UserError
from ..core.hashing import digest
from ..datasets.base import digest_of
from ..display.api import Exposure
from ..display.traits import traits_of
from . import identity, isolation
from .definition import Measure, MethodEntry, Study
from .displays import Condition, Preparation, changed, displays, preparation
from .stacks import Showing, Target, at_once, given_views, offset, sharing, showings, stacks_of, targets_a_scene
from .versions import HARNESS, dataset_version, method_version

REFERENCE = "reference"  # the condition of the floor cells, see ``reference_of``
PATHS = ("path", "manifest")  # parameters of datasets that say where images lie; each image has its digest
FLOORS = (  # what a study without any display would score: see ``holobench_eval.metrics.references``
    "floor_constant",
    "floor_black",
    "floor_speckle",
    "floor_wrong_target",
    "floor_mirrored",
    "floor_shift_1px",
)


def reference_of(display: str) -> str:
    """The condition of the floor cells of a display whose targets are not those of the study's first."""
    return f"{REFERENCE} for {display}"


def is_reference(condition: str) -> bool:
    """Whether a condition is that of floor cells."""
    return condition == REFERENCE or condition.startswith(reference_of(""))


@dataclass(frozen=True)
class Cell:
    """A number of a table, before it is measured: a phase, a capture of it, and what reports say of both.

    phase: its description (``identity.phase``), or what a floor image is made of; shown_on: the display (None for a
    floor image that needs none); method: registered name or ``file.py:Class``; code: its version
    (``versions.method_version``); params: all of them; target_sha256: digest of the source image; condition: name of
    the display, or the floor's (``is_reference``); repeat, seed: names of the noise; measure: what is scored, see
    ``Study``; holograms: of predictions, the method whose captures are predicted, with the description of its phase;
    prepared: what the method and the display had to learn first (``Preparation.id``); captures: the most that the
    display allows while the target is solved (None: no limit); files: digests of the files that the method reads for
    the target, by their paths; starts: ids of the cells of other methods whose phases the method starts from.
    """

    phase: Mapping[str, Any]
    shown_on: Condition | None
    method: str
    code: str
    params: Mapping[str, Any]
    dataset: str
    dataset_params: Mapping[str, Any]
    target: str
    target_sha256: str
    profile: str
    profile_version: int
    panel: tuple[int, int]
    condition: str
    repeat: int
    seed: int
    protocol: str
    exposure: Exposure
    measure: Measure = "picture"
    holograms: Mapping[str, Any] = field(default_factory=dict)
    prepared: tuple[str, ...] = ()
    captures: int | None = None
    files: Mapping[str, str] = field(default_factory=dict)
    starts: tuple[str, ...] = ()

    @property
    def change(self) -> dict[str, Any]:
        """Kind and value of what has changed on the display since methods were prepared for it; empty: nothing."""
        return dict([self.shown_on.change]) if self.shown_on and self.shown_on.change else {}

    @cached_property
    def phase_id(self) -> str:
        """The name of the phase."""
        return digest(self.phase)

    def description(self) -> dict[str, Any]:
        """The description of the capture, see ``identity.capture``."""
        noise = [self.seed, self.target, self.repeat] if self.shown_on else []
        measure = self.measure if self.measure != "picture" else ""
        further = {"noise": noise, "exposure": self.exposure if self.shown_on else "", "measure": measure}
        return identity.capture(self.phase, self.shown_on, holograms=self.holograms.get("phase"), **further)

    @cached_property
    def id(self) -> str:
        """The name of the capture, and of its record."""
        return digest(self.description())

    def facts(self) -> dict[str, Any]:
        """What reports say of the cell, as plain values."""
        names = [item.name for item in fields(self) if item.name not in ("phase", "shown_on", "holograms", "files")]
        return identity.as_json({name: getattr(self, name) for name in names} | {"change": self.change})


@dataclass(frozen=True)
class Task:
    """Cells that share a phase: a method solves a target once, and the phase is shown on each of the displays.

    conditions: the display of each cell; the method solves on the first. A floor task has no
    solution and one display, which gives the size of the scored region. preparation: what the method learns first.
    """

    label: str
    cells: tuple[Cell, ...]
    conditions: tuple[Condition, ...]
    preparation: Preparation | None = None

    @property
    def is_floor(self) -> bool:
        """Whether the cells are floor cells, which have no method."""
        return is_reference(self.cells[0].condition)


@dataclass(frozen=True)
class Plan:
    """Every task of a study, in the order in which they are run and reported; metrics: see ``identity.scores_of``."""

    tasks: tuple[Task, ...]
    metrics: Mapping[str, str] = field(default_factory=dict)

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
    (40, 80)
    """
    targets = [(item, digest_of(study.dataset, item)) for item in study.items]
    displays_by_source = displays(study)
    ground = _Ground(study)
    apart = targets_a_scene(ground.stacks) if ground.stacks else 1
    tasks = [
        ground.floor(display, condition, target, targets[(i + apart) % len(targets)])
        for display, condition in _references(study, [*displays_by_source.values()])
        for i, target in enumerate(targets)
    ]
    for entry in study.methods:
        shown = [changed(study, source, displays_by_source[source]) for source in entry.profiles]
        tasks += ground.solutions(entry, [display for each in shown for display in each], targets)
    grid = Plan(tuple(following(tasks, study.folder)), identity.scores_of(study))
    scored = {sha256: name for name, sha256 in targets}
    for item, sha256 in (image for training in grid.preparations().values() for image in training.images):
        if sha256 in scored:
            raise UserError(f"training image '{item}' is the scored target '{scored[sha256]}'; train on others")
    return grid


@dataclass(frozen=True)
class _Ground:
    """What all cells of a study have in common."""

    study: Study

    @cached_property
    def stacks(self) -> dict[str, tuple[str, float]]:
        """Scene of every target of focal stacks or light fields, and its plane [mm] or place."""
        return stacks_of(self.study.dataset, self.study.targets.dataset, self.study.measure)

    @cached_property
    def probe(self) -> Any:
        """The method whose captures are predicted."""
        return isolation.build(self.study.holograms.name, self.study.holograms.params, self.study.folder)

    @cached_property
    def source(self) -> dict[str, Any]:
        """What every target's pixels depend on besides its source: the dataset, wherever its images lie."""
        dataset, chosen = self.study.dataset, self.study.targets
        params = {name: value for name, value in chosen.params.items() if name not in PATHS}
        code = dataset_version(chosen.dataset, type(dataset))
        return {"dataset": chosen.dataset.rpartition(":")[2], "params": params, **({"code": code} if code else {})}

    def cell(self, phase: Mapping[str, Any], display: Condition, target: Target, code: str, **further: Any) -> Cell:
        """A cell; ``display``: gives the size of the scored region, also of a floor image that needs no display.

        A floor image, which has no code, is shown on none unless it is compared with the captures of one.
        """
        study = self.study
        return Cell(
            phase,
            display if code or study.predicts else None,
            code=code,
            dataset=study.targets.dataset,
            dataset_params=study.targets.params,
            target=target[0],
            target_sha256=target[1],
            profile=display.name,
            profile_version=display.version,
            panel=display.spec.shape,
            seed=study.seed,
            protocol=study.protocol.version,
            measure=study.measure,
            **further,
        )

    def solutions(self, entry: MethodEntry, entry_displays: list[Condition], targets: list[Target]) -> Iterator[Task]:
        """A task for every solution of a method: target by target, repeat by repeat."""
        study, cls = self.study, isolation.find(entry.name, self.study.folder)
        solved = {target: self._solved(target) for target in targets}
        read = isolation.files_read(entry, study.folder, dict.fromkeys(name for name, _ in solved.values()))
        for showing in self._showings(cls, entry_displays, targets):
            conditions = tuple(display for _, display in showing)
            first = conditions[0].nominal if self.stacks else conditions[0]
            own = preparation(study, entry.name, entry.params, first.nominal)
            learned, planes = own.id if own else "", self._planes(cls, showing, first)

            for repeat in range(study.repeats):
                cells = list[Cell]()
                for target, display in showing:
                    both = {"files": read[solved[target][0]], "captures": entry.captures}
                    holograms = self._holograms(display, target, repeat)  # a prediction has a task for each display
                    further = {**both, "learned": learned, "planes": planes, "predicts": holograms.get("phase")}
                    phase = self._phase(cls, entry.params, solved[showing[0][0]], first, repeat, **further)
                    cell = self.cell(
                        phase,
                        display,
                        target,
                        method=entry.name,
                        code=method_version(cls),
                        params=entry.params,
                        condition=display.name if self.stacks else display.title,  # planes and views share a row
                        repeat=repeat,
                        prepared=tuple(training.id for training in (own, display.learned) if training),
                        exposure=entry.exposure or study.display.exposure,
                        holograms=holograms,
                        **both,
                    )
                    cells.append(cell)
                yield Task(entry.label, tuple(cells), conditions, own)

    def _phase(
        self, cls: type[Any], params: Mapping[str, Any], target: Target, display: Condition, repeat: int, **further: Any
    ) -> dict[str, Any]:
        """The description of a method's phase of a target on a display. further: see ``identity.phase``."""
        traits = traits_of(cls)
        return identity.phase(
            method_version(cls),
            params,
            self.source | {"sha256": target[1]},
            display.spec,
            (self.study.seed, target[0], repeat),
            display=identity.seen(display) if traits.sees else {},
            harness=HARNESS if traits.simulates else "",
            **further,
        )

    def _planes(self, cls: type[Any], showing: Showing, display: Condition) -> list[list[Any]]:
        """The targets of a phase for a whole scene, each with its distance from the plane of the display, or place."""
        if not at_once(traits_of(cls), self.study.measure):
            return []
        if self.study.measure == "views":
            return [[sha256, place] for _, sha256, place in given_views(self.study.dataset, showing[0][0][0])]
        changes = {sha256: dict([at.change] if at.change else []) for (_, sha256), at in showing}
        return [[sha256, offset(display, change)] for sha256, change in changes.items()]

    def _solved(self, target: Target) -> Target:
        """The picture that a phase is named by: a target itself, or the first view of its scene that methods get."""
        if self.study.measure != "views":
            return target
        name, sha256, _ = given_views(self.study.dataset, target[0])[0]
        return name, sha256

    def _holograms(self, display: Condition, target: Target, repeat: int) -> dict[str, Any]:
        """The method whose captures are predicted, and the description of its phase; empty for pictures."""
        probe = self.study.holograms
        if not self.study.predicts:
            return {}
        cls, files = type(self.probe), isolation.digests(self.probe, target[0])
        phase = self._phase(cls, probe.params, target, display, repeat, files=files)
        return {"name": probe.name, "params": probe.params, "code": method_version(cls), "files": files, "phase": phase}

    def _showings(self, cls: type[Any], entry_displays: list[Condition], targets: list[Target]) -> Iterator[Showing]:
        """The targets and displays of each solution."""
        for group in sharing(cls, entry_displays, self.study.predicts):
            if self.stacks:
                yield from showings(cls, group, targets, self.stacks, self.study.measure)
            else:
                yield from ([(target, display) for display in group] for target in targets)

    def floor(self, display: Condition, condition: str, target: Target, wrong: Target) -> Task:
        """The references of a target; ``wrong``: the target whose picture is scored as the wrong one."""
        study = self.study
        wrong_target = {"target": wrong[0], "target_sha256": wrong[1]}
        params = {name: wrong_target if name == "floor_wrong_target" else {} for name in FLOORS}
        if wrong == target:
            del params["floor_wrong_target"]
        holograms = self._holograms(display, target, 0)
        source = self.source | {"sha256": target[1]}
        made_of = {"target": source, "size": list(display.spec.region.shape), "draw": [study.seed, target[0]]}
        if condition != REFERENCE or len(display.spec.wavelengths) == 1:
            made_of["display"] = display.name
        cells = tuple(
            self.cell(
                {"floor": name, **made_of, **({"wrong": wrong[1]} if own else {})},
                display,
                target,
                method=name,
                code="",
                params=own,
                condition=condition,
                repeat=0,
                exposure=study.display.exposure,
                prepared=(display.learned.id,) if display.learned else (),
                holograms=holograms | ({"wrong": self._holograms(display, wrong, 0)} if own and holograms else {}),
            )
            for name, own in params.items()
        )
        return Task("floor", cells, (display,) * len(cells))


def _references(study: Study, shown: Sequence[Condition]) -> Iterator[tuple[Condition, str]]:
    """The first display, and those whose targets are of another size or other colours, with their floor's condition.

    Predictions are compared with captures, and their floor with those of the first display alone.
    """
    first, *others = [(display.spec.region.shape, len(display.spec.wavelengths)) for display in shown]
    yield shown[0], REFERENCE
    for display, size in zip(shown[1:], others, strict=True):
        if size != first and not study.predicts:
            yield display, reference_of(display.name)


def following(tasks: Sequence[Task], folder: Path) -> Iterator[Task]:
    """The same tasks, with the ``starts`` of methods that follow others (``follows = True``): the cells of all others
    for the same target on the same display in the same repeat, sorted, so that their order in the config is no matter.

    folder: of the config.
    """

    def follows(task: Task) -> bool:
        return not task.is_floor and isolation.traits(task.cells[0].method, folder).follows

    others = defaultdict[tuple[str, str, int], list[Cell]](list)
    for task in tasks:
        for cell in () if task.is_floor or follows(task) else task.cells:
            others[cell.target, cell.condition, cell.repeat].append(cell)

    def started(cell: Cell) -> Cell:
        starts = others[cell.target, cell.condition, cell.repeat]
        phase = {**cell.phase, "starts": sorted({start.phase_id for start in starts})}
        return replace(cell, phase=phase, starts=tuple(sorted(start.id for start in starts)))

    for task in tasks:
        yield replace(task, cells=tuple(map(started, task.cells))) if follows(task) else task
