"""What tables need to know of a study beside its records: a row a method, a row a condition, a row a target."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple, cast

import pandas as pd

from ..core import plugins
from ..datasets.base import clusters_of
from ..display.simulated.changes import KINDS, draws
from ..display.simulated.profile import Profile, load_profile
from ..study import isolation
from ..study.config import load_study
from ..study.definition import PREDICTIONS, Claim, DisplayGrid, Measure, MethodEntry, Study, Targets
from ..study.displays import Condition, changed, displays
from ..study.folders import FILES
from ..study.plan import is_reference
from ..study.stacks import at_once, stacks_of
from .text import Text, plain, text_of

# Who competes with whom: methods are ranked among those that were given as much of the camera.
OPEN_LOOP, CALIBRATED, ONLINE, ORACLE, GIVEN = "open loop", "calibrated", "online", "oracle", "given"
FLOOR = "floor"  # in files, of rows that no method made
# Methods that, as far as is known, never see a capture of the scored image: their holograms are ready before it.
OFFLINE = (OPEN_LOOP, CALIBRATED, GIVEN)
PLACES = {
    "focus": ("plane", "mm"),
    "views": ("place", "iris radii"),
}  # what a target of these measures says of its display
UNCHANGED: dict[str, Any] = {"swept": "", "swept_value": math.nan, "swept_unit": "", "swept_name": ""}


class TrainingSet(NamedTuple):
    """What all methods of a study may train on: a dataset with its parameters, how many images it has, how many of them
    only watch the training, and the most captures that a method may take (None: no limit)."""

    dataset: str
    images: int
    held_out: int
    captures: int | None


@dataclass(frozen=True)
class Swept:
    """A change of a display, by one value after another, and the conditions under which cells stand for it.

    kind: of ``display.simulated.changes``; before: the condition without the change; points: (value, condition) of
    each other one, in the order of the config; drawn: of random draws, the value of each parameter that the display
    has, by its name in ``display.simulated.changes.draws``, a mapping per point; claim: what was published of it.
    """

    kind: str
    before: str
    points: tuple[tuple[float | str, str], ...]
    drawn: tuple[Mapping[str, float], ...] = ()
    claim: Claim | None = None

    def changes(self) -> Iterator[tuple[str, dict[str, Any]]]:
        """The condition of each point, and what was changed: a number with its unit, or a name."""
        kind = KINDS[self.kind]
        unit = "1" if kind.unit.startswith("of ") else kind.unit
        for value, condition in self.points:
            if kind.numeric or kind.counted:
                number = float(f"{float(value):.6g}")
                yield condition, {**UNCHANGED, "swept": self.kind, "swept_value": number, "swept_unit": unit}
            else:
                yield condition, {**UNCHANGED, "swept": self.kind, "swept_name": str(value)}


@dataclass(frozen=True)
class Facts:
    """A study, as its tables see it, each frame in the order of the config.

    methods, by label: method, title (a name for people, empty for none), params, category, trained, blind (its training
    takes no photograph), identity (its network is the ideal image itself, which has nothing to learn), stacked (it
    receives all planes or views of a scene), tuned (on what its settings were chosen), limit (of captures).
    displays, by name: panel (rows and columns [px]) and shape (of targets, (C, h, w)). targets, by name: cluster, scene
    and place (plane [mm], or place of the eye's pupil [radii of the iris]). pairs: (label, condition) of each planned
    row; sweeps: which conditions are changes of others; training: what methods may train on (None: nothing is trained);
    network: the display that is a trained network (empty: benches); beside: the condition that published figures stand
    beside (empty: each); profiles: of simulated displays; related: facts of the parts that predict, by their names;
    changed: the conditions that are a change of another, with that change.
    """

    study: Study
    methods: pd.DataFrame
    displays: pd.DataFrame
    targets: pd.DataFrame
    pairs: tuple[tuple[str, str], ...]
    sweeps: tuple[Swept, ...] = ()
    training: TrainingSet | None = None
    network: str = ""
    beside: str = ""
    profiles: Mapping[str, Profile] = field(default_factory=dict)
    related: Mapping[str, Facts] = field(default_factory=dict)
    changed: dict[str, dict[str, Any]] = field(init=False)

    def __post_init__(self) -> None:
        """Find the conditions that are a change of another, with that change."""
        changes = dict(change for sweep in self.sweeps for change in sweep.changes())
        object.__setattr__(self, "changed", changes)

    def of(self, label: str, name: str, unknown: Any = "") -> Any:
        """A fact of a method; ``unknown`` for a row that is not in the config."""
        value: Any = self.methods.at[label, name] if label in self.methods.index else unknown
        return value

    def labels(self, name: str) -> frozenset[str]:
        """Labels of the methods for which a fact holds."""
        return frozenset(self.methods.index[self.methods[name].astype(bool)])

    def category(self, label: str) -> str:
        """The category that a method competes in."""
        return str(self.of(label, "category", GIVEN if self.study.measure == FILES else OPEN_LOOP))

    def panel(self, display: str) -> tuple[int, int] | None:
        """Rows and columns of the panel of a display [px]; None where they are not known."""
        value: Any = self.displays.at[display, "panel"] if display in self.displays.index else None
        return value

    @cached_property
    def oracles(self) -> frozenset[str]:
        """Labels of methods that may differentiate through the bench, which are no competitors."""
        return frozenset(label for label in self.methods.index if self.category(label) == ORACLE)

    @property
    def predicts(self) -> bool:
        """Whether predictions are compared with captures."""
        return self.study.measure in PREDICTIONS

    @property
    def spends(self) -> bool:
        """Whether some method takes captures, for its training or while it solves."""
        known = self.methods
        return bool((known["trained"] & ~known["blind"] | (known["category"] == ONLINE)).any())

    @property
    def text(self) -> Text:
        """What is compared, in words."""
        return text_of(self.study, bool(self.network))

    def marked(self, label: str) -> str:
        """A method's label, marked when it is the oracle."""
        return f"{label}, oracle" if self.category(label) == ORACLE and "oracle" not in label.lower() else label

    def published(self, label: str, condition: str) -> Mapping[str, float]:
        """Published figures of a row, by metric."""
        reported = self.study.reported
        return reported.rows.get(label, {}) if reported and self.beside in ("", condition) else {}

    @property
    def published_metrics(self) -> list[str]:
        """Names of the published figures, in the order in which the config first names them."""
        reported = self.study.reported
        return list(dict.fromkeys(name for row in reported.rows.values() for name in row)) if reported else []

    def row(self, label: str, display: str, condition: str, target: str) -> dict[str, Any]:
        """The columns of a record that follow from the config."""
        change, study = self.changed.get(condition, UNCHANGED), self.study
        if (
            change is UNCHANGED
            and study.measure in PLACES
            and target in self.targets.index
            and not is_reference(condition)
        ):
            kind, unit = PLACES[study.measure]
            change = {**UNCHANGED, "swept": kind, "swept_value": self.targets.at[target, "place"], "swept_unit": unit}
        height, width = self.panel(display) or (math.nan, math.nan)
        limit = self.of(label, "limit", math.nan)
        own = {"study": study.name, "measure": study.measure, "seed": study.seed, "capture_limit": limit}
        return {**own, "panel_height_px": height, "panel_width_px": width, **change}


def facts_of(study: Study) -> Facts:
    """The facts of a checked study. Reads its profiles and lists its dataset; computes nothing."""
    conditions = displays(study)
    names, methods, pairs = {source: one.name for source, one in conditions.items()}, {}, []
    for entry in study.methods:
        traits, params = isolation.traits(entry.name, study.folder), entry.params
        blind = "blind" in traits.functions and isolation.build(entry.name, params, study.folder).blind()
        kinds = {ORACLE: traits.privileged, ONLINE: traits.camera, CALIBRATED: traits.trains and not blind}
        is_own = re.match(rf"{re.escape(entry.name)}(?![\w-])", entry.label)
        network = params.get("network")
        methods[entry.label] = {
            "method": entry.name,
            "title": f"{traits.title}{entry.label.removeprefix(entry.name)}" if traits.title and is_own else "",
            "params": params,
            "category": next((kind for kind, holds in kinds.items() if holds), OPEN_LOOP),
            "trained": traits.trains,
            "blind": blind,
            "identity": isinstance(network, Mapping) and network.get("name") == "identity",
            "stacked": at_once(traits, study.measure),
            "tuned": traits.tuned,
            "limit": math.nan if entry.captures is None else entry.captures,
        }
        for source in entry.profiles:
            pairs += [(entry.label, each.title) for each in changed(study, source, conditions[source])]
    trains = any(row["trained"] for row in methods.values()) or study.display.learned
    reported = study.reported
    return Facts(
        study,
        pd.DataFrame.from_dict(methods, "index"),
        pd.DataFrame.from_dict({one.name: _display(one) for one in conditions.values()}, "index"),
        targets_of(study),
        tuple(pairs),
        tuple(_sweeps(study, conditions)),
        _training(study) if trains else None,
        next(iter(names.values())) if study.display.learned else "",
        names[reported.beside] if reported and reported.beside else "",
        {
            one.name: load_profile(source, study.folder)
            for source, one in conditions.items()
            if one.real is None and one.learned is None
        },
        {
            name: facts_of(load_study(study.file / name))
            for name, keys in study.parts.items()
            if keys.get("measure") in PREDICTIONS and not study.predicts
        },
    )


def facts_of_files(
    name: str,
    title: str,
    pairs: Sequence[tuple[str, str]],
    targets: tuple[str, ...],
    values: str,
    note: str,
    baseline: str | None,
) -> Facts:
    """The facts of pictures that were given as files. name: of the report's folder; values: how they were read,
    ``stored``, ``srgb`` or ``linear``."""
    labels = list(dict.fromkeys(label for label, _ in pairs))
    study = Study(
        title,
        DisplayGrid(),
        Targets(FILES, {"values": values}, targets),
        tuple(MethodEntry(label, label) for label in labels),
        cast(Measure, FILES),
        headline=f"psnr_{'stored' if values == 'stored' else 'linear'}",
        baseline=baseline or "",
        note=note,
        file=Path(f"{name}.yaml"),
    )
    rows = {"cluster": targets, "scene": "", "place": math.nan}
    known: dict[str, Any] = {"category": GIVEN, "params": {}} | dict.fromkeys(
        ("trained", "blind", "identity", "stacked"), False
    )
    known |= {"method": "", "title": "", "tuned": None, "limit": math.nan}
    methods = pd.DataFrame.from_dict(dict.fromkeys(labels, known), "index")
    return Facts(study, methods, pd.DataFrame(), pd.DataFrame(rows, index=list(targets)), tuple(pairs))


def _display(display: Condition) -> dict[str, Any]:
    spec = display.spec
    return {"panel": spec.shape, "shape": (len(spec.wavelengths), *spec.region.shape)}


def targets_of(study: Study) -> pd.DataFrame:
    """The frame of the targets of a study."""
    places, clusters = stacks_of(study.dataset, study.targets.dataset, study.measure), clusters_of(study.dataset)
    rows = [(name, clusters.get(name, name), *places.get(name, ("", math.nan))) for name in study.items]
    return pd.DataFrame(rows, columns=["target", "cluster", "scene", "place"]).set_index("target")


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
    """What was drawn at each point, without the parameters of stages that the display lacks."""
    profile = load_profile(before.source, folder=before.folder)
    ranges = draws.PARAMETERS.items()
    effective = {name for name, drawn in ranges if drawn.put(profile, drawn.low) != drawn.put(profile, drawn.high)}
    values = (draws.values(profile, int(index)) for index, _ in points)
    return tuple({name: value for name, value in draw.items() if name in effective} for draw in values)


def _training(study: Study) -> TrainingSet:
    chosen = study.training
    images = plugins.build("datasets", chosen.dataset, dict(chosen.params), study.folder).items()
    return TrainingSet(f"{chosen.dataset} ({plain(chosen.params)})", len(images), chosen.held_out, chosen.captures)
