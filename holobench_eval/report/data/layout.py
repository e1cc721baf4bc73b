"""What the tables need to know of a study: which rows there should be, in which order, and how they are marked."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

from ...core import plugins
from ...datasets.base import clusters_of
from ...display.simulated.changes import KINDS, draws
from ...display.simulated.profile import Profile, load_profile
from ...study import isolation
from ...study.config import load_study
from ...study.definition import PREDICTIONS, Claim, Study
from ...study.displays import Condition, changed, displays
from ...study.plan import is_reference
from ...study.stacks import at_once, stacks_of
from .text import AS_STORED, BY_MEASURE, COMPARED, FILES, ON_A_NETWORK, REAL, Text, plain

# Who competes with whom: methods are ranked among those that were given as much of the camera.
OPEN_LOOP = "open loop"
CALIBRATED = "calibrated"
ONLINE = "online"
ORACLE = "oracle"
GIVEN = "given"
FLOOR = "floor"  # in files, of rows that no method made

# In the order of tables.
CATEGORIES = (OPEN_LOOP, CALIBRATED, ONLINE, ORACLE, GIVEN)
# Methods that, as far as is known, never see a capture of the scored image: their holograms are ready before it.
OFFLINE = (OPEN_LOOP, CALIBRATED, GIVEN)

RATIO = "1"  # unit of a swept ratio


class Change(NamedTuple):
    """What was changed on a display, as the files say it: a number with its unit, or a name."""

    swept: str = ""
    swept_value: float = math.nan
    swept_unit: str = ""
    swept_name: str = ""


@dataclass(frozen=True)
class TrainingSet:
    """What all methods of a study may train on.

    dataset: its name and parameters; images: how many there are; held_out: how many of them only watch the training;
    captures: the most that a method may take (None: no limit).
    """

    dataset: str
    images: int
    held_out: int
    captures: int | None


@dataclass(frozen=True)
class Swept:
    """A change of a display, by one value after another, and the conditions under which cells stand for it.

    kind: of ``display.simulated.changes``; before: the condition without the change; points: (value, condition) of
    every other one, in the order of the config; drawn: of random draws, the value of each parameter that the display
    has, by its name in ``display.simulated.changes.draws``, a mapping per point; claim: what was published of it.
    """

    kind: str
    before: str
    points: tuple[tuple[float | str, str], ...]
    drawn: tuple[Mapping[str, float], ...] = ()
    claim: Claim | None = None

    def change(self, value: float | str) -> Change:
        """What was changed at a point."""
        kind = KINDS[self.kind]
        if not (kind.numeric or kind.counted):
            return Change(self.kind, swept_name=str(value))
        return Change(self.kind, float(f"{float(value):.6g}"), RATIO if kind.unit.startswith("of ") else kind.unit)


@dataclass(frozen=True)
class Layout:
    """The rows of a study's tables.

    pairs: (method label, condition) of every planned row, in the order of the config: methods, then conditions.
    targets: what every pair is measured on, in the order of the dataset; seed: of the study.
    baseline: label that every method is tested against (None: no such tests).
    headline: score key of the headline metric, such as ``psnr_linear``.
    privileged: labels of methods that may differentiate through the bench; they are oracles, not competitors.
    reported: published figures by label, ``{label: {metric: value}}``, and where they were published;
    reported_beside: the condition whose rows they stand beside (None: every one's).
    question: what the study asks (empty: what its kind asks); would_change: which result would change the answer;
    titles: names for people, by label, where it begins with the method's name; tuned: on what the settings of methods
    were chosen, by label.
    note: a paragraph that the study wants among its limits. measure: that of the study, or ``files`` (pictures that
    were given as files; values: how they were read, ``stored``, ``srgb`` or ``linear``);
    holograms: whose captures are predicted, with parameters. planes: scene of every target of focal stacks or light
    fields, and its plane [mm] or the place of the eye's pupil; stacked: labels of methods that receive all planes or
    views of a scene. learned_display: the condition that is a trained network (None: benches).
    trained: labels of methods that are trained before they solve; blind: of those among them whose training takes no
    photograph; training: on what (None: nothing is trained);
    identities: labels of those whose network is the ideal image itself, which has nothing to learn.
    camera: labels of methods that may capture the scored image while they solve. sweeps: which conditions are changes
    of others. real: whether the display exists. clusters: of every target, such as the photograph of a crop (empty:
    each target is its own). metrics: names of those the study wants (None: all). study: its name, the config's file
    without the ending; params: every parameter of a method, by label; capture_limits: the most captures that a display
    allows a method for a target, by label; panels: rows and columns of the panel of each display [px]; shapes: of the
    targets as each display is to show them, ``(C, h, w)``; profiles: of simulated displays; related: layouts of the
    parts that predict, by their names; parts: names of all parts.
    """

    title: str
    pairs: tuple[tuple[str, str], ...]
    targets: tuple[str, ...]
    seed: int = 0
    headline: str = "psnr_linear"
    baseline: str | None = None
    privileged: frozenset[str] = frozenset()
    reported: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    reported_source: str = ""
    reported_beside: str | None = None
    question: str = ""
    would_change: str = ""
    titles: Mapping[str, str] = field(default_factory=dict)
    tuned: Mapping[str, str] = field(default_factory=dict)
    note: str = ""
    measure: str = "picture"
    holograms: str = ""
    learned_display: str | None = None
    trained: frozenset[str] = frozenset()
    blind: frozenset[str] = frozenset()
    training: TrainingSet | None = None
    identities: frozenset[str] = frozenset()
    camera: frozenset[str] = frozenset()
    sweeps: tuple[Swept, ...] = ()
    planes: Mapping[str, tuple[str, float]] = field(default_factory=dict)
    stacked: frozenset[str] = frozenset()
    metrics: tuple[str, ...] | None = None
    real: bool = False
    clusters: Mapping[str, str] = field(default_factory=dict)
    values: str = ""
    study: str = ""
    params: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    capture_limits: Mapping[str, int] = field(default_factory=dict)
    panels: Mapping[str, tuple[int, int]] = field(default_factory=dict)
    shapes: Mapping[str, tuple[int, int, int]] = field(default_factory=dict)
    profiles: Mapping[str, Profile] = field(default_factory=dict)
    related: Mapping[str, Layout] = field(default_factory=dict)
    parts: tuple[str, ...] = ()

    def category(self, label: str) -> str:
        """The category that a method competes in."""
        if self.measure == FILES:
            return GIVEN
        if label in self.privileged:
            return ORACLE
        if label in self.camera:
            return ONLINE
        return CALIBRATED if label in self.trained - self.blind else OPEN_LOOP

    @property
    def predicts(self) -> bool:
        """Whether predictions are compared with captures."""
        return self.measure in PREDICTIONS

    @property
    def spends_captures(self) -> bool:
        """Whether some method takes captures, for its training or while it solves."""
        return bool(self.trained - self.blind or self.camera)

    @property
    def text(self) -> Text:
        """What is compared, in words."""
        on_a_network = self.learned_display is not None and self.measure == "picture"
        text, holograms = ON_A_NETWORK if on_a_network else BY_MEASURE[self.measure], self.holograms.partition(" (")[0]
        if self.measure == FILES:
            stored = self.values == "stored"
            text = replace(text, compared=COMPARED[self.values], caution=AS_STORED if stored else text.caution)
        if self.real:
            text = replace(text, displays=REAL)
        procedure, picture = (words.replace("{holograms}", holograms) for words in (text.procedure, text.picture))
        return replace(text, procedure=procedure, picture=picture)

    def marked(self, label: str) -> str:
        """A method's label, marked when it is the oracle."""
        return f"{label}, oracle" if label in self.privileged and "oracle" not in label.lower() else label

    def published(self, label: str, condition: str) -> Mapping[str, float]:
        """Published figures of a row, by metric."""
        return self.reported.get(label, {}) if self.reported_beside in (None, condition) else {}

    @property
    def methods(self) -> tuple[str, ...]:
        """Method labels in the order of the config."""
        return tuple(dict.fromkeys(label for label, _ in self.pairs))

    @cached_property
    def changed(self) -> dict[str, Change]:
        """Conditions that are a change of another, with that change."""
        return {condition: sweep.change(value) for sweep in self.sweeps for value, condition in sweep.points}

    def change(self, condition: str, target: str = "") -> Change:
        """What was changed under a condition; the plane or place of a target is a change of its display."""
        if condition in self.changed or is_reference(condition) or target not in self.planes:
            return self.changed.get(condition, Change())
        kind, unit = ("plane", "mm") if self.measure == "focus" else ("place", "iris radii")
        return Change(kind, self.planes[target][1], unit)

    @property
    def reported_metrics(self) -> tuple[str, ...]:
        """Names of the published figures, in the order in which the config first names them."""
        return tuple(dict.fromkeys(name for row in self.reported.values() for name in row))


def layout_of(study: Study) -> Layout:
    """The layout of a checked study. Reads its profiles and lists its dataset; computes nothing."""
    reported = study.reported
    conditions = displays(study)
    names = {source: condition.name for source, condition in conditions.items()}
    profiles = {
        condition.name: load_profile(source, study.folder)
        for source, condition in conditions.items()
        if condition.real is None and condition.learned is None
    }
    traits = {entry.label: isolation.traits(entry.name, study.folder) for entry in study.methods}
    trained = frozenset(label for label, method in traits.items() if method.trains)
    return Layout(
        title=study.title,
        pairs=tuple(
            (entry.label, condition.title)
            for entry in study.methods
            for source in entry.profiles
            for condition in changed(study, source, conditions[source])
        ),
        targets=study.items,
        seed=study.seed,
        headline=study.headline,
        baseline=study.baseline,
        privileged=frozenset(label for label, method in traits.items() if method.privileged),
        reported=reported.rows if reported else {},
        reported_source=reported.source if reported else "",
        reported_beside=names[reported.beside] if reported and reported.beside else None,
        question=study.question,
        would_change=study.would_change,
        titles={
            entry.label: f"{title}{entry.label.removeprefix(entry.name)}"
            for entry in study.methods
            if (title := traits[entry.label].title) and re.match(rf"{re.escape(entry.name)}(?![\w-])", entry.label)
        },
        tuned={label: method.tuned for label, method in traits.items() if method.tuned is not None},
        note=study.note,
        measure=study.measure,
        metrics=study.protocol.metrics,
        holograms=f"{study.holograms.name} ({plain(study.holograms.params)})" if study.predicts else "",
        learned_display=next(iter(names.values())) if study.display.learned else None,
        trained=trained,
        blind=frozenset(
            entry.label
            for entry in study.methods
            if "blind" in traits[entry.label].functions
            and isolation.build(entry.name, entry.params, study.folder).blind()
        ),
        identities=frozenset(entry.label for entry in study.methods if network_of(entry.params) == "identity"),
        training=_training_set(study) if trained or study.display.learned else None,
        camera=frozenset(label for label, method in traits.items() if method.camera),
        sweeps=tuple(_sweeps(study, conditions)),
        planes=stacks_of(study.dataset, study.targets.dataset, study.measure),
        real=study.display.real,
        clusters=clusters_of(study.dataset),
        stacked=frozenset(label for label, method in traits.items() if at_once(method, study.measure)),
        study=study.name,
        params={entry.label: entry.params for entry in study.methods},
        capture_limits={entry.label: entry.captures for entry in study.methods if entry.captures is not None},
        panels={condition.name: condition.spec.shape for condition in conditions.values()},
        shapes={each.name: (len(each.spec.wavelengths), *each.spec.region.shape) for each in conditions.values()},
        profiles=profiles,
        related={
            name: layout_of(load_study(study.file / name))
            for name, keys in study.parts.items()
            if keys.get("measure") in PREDICTIONS and not study.predicts
        },
        parts=() if study.changes else tuple(study.parts),
    )


def network_of(params: Any) -> str:
    """The name of a method's network, empty where it has none."""
    network = params.get("network") if isinstance(params, Mapping) else None
    return str(network.get("name", "")) if isinstance(network, Mapping) else ""


def _sweeps(study: Study, conditions: Mapping[str, Condition]) -> Iterator[Swept]:
    for kind in dict.fromkeys(sweep.condition for sweep in study.sweeps):
        same = tuple(sweep for sweep in study.sweeps if sweep.condition == kind)
        for source, before in conditions.items():
            after = changed(replace(study, sweeps=same), source, before)[1:]
            points = tuple((condition.change[1], condition.title) for condition in after if condition.change)
            if points:
                drawn = _drawn(before, points) if kind == "draw" else ()
                claim = next((sweep.claim for sweep in same if sweep.claim), None)
                yield Swept(kind, before.name, points, drawn, claim)


def _drawn(before: Condition, points: tuple[tuple[float | str, str], ...]) -> tuple[dict[str, float], ...]:
    """What was drawn at every point, without the parameters of stages that the display lacks."""
    profile = load_profile(before.source, folder=before.folder)
    ranges = draws.PARAMETERS.items()
    effective = {name for name, drawn in ranges if drawn.put(profile, drawn.low) != drawn.put(profile, drawn.high)}
    values = (draws.values(profile, int(index)) for index, _ in points)
    return tuple({name: value for name, value in draw.items() if name in effective} for draw in values)


def _training_set(study: Study) -> TrainingSet:
    chosen = study.training
    images = plugins.build("datasets", chosen.dataset, dict(chosen.params), study.folder).items()
    return TrainingSet(f"{chosen.dataset} ({plain(chosen.params)})", len(images), chosen.held_out, chosen.captures)
