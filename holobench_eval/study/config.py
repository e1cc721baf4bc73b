"""Read a study from ``configs/*.yaml`` and check all of it before anything runs.

Every mistake in a config is reported in one line that starts with its position, ``configs/table3.yaml:12:5: ...``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from ..core import plugins
from ..core.errors import UserError, suggest
from ..core.schema import placed, typed
from ..core.yaml_source import Document, Keys, load
from ..display.simulated.changes import KINDS, altered, checked
from ..display.simulated.profile import load_profile
from ..display.traits import traits_of
from ..imaging.grid import SMALLEST_REGION
from ..metrics import Metric, catalogue
from ..metrics.lpips import find_weights
from . import isolation
from .changes import Changes, changed, chosen
from .definition import DisplayGrid, MethodEntry, Probe, Protocol, Study, Sweep, Targets, Training
from .displays import condition, displays, real_condition
from .focal_stacks import SCORES, planes_of
from .plan import FLOORS, REFERENCE


def load_study(path: Path | str, changes: Changes | None = None) -> Study:
    """Read a study and check all of it.

    Parameters
    ----------
    path
        A YAML file; relative paths of code, profiles, benches and weights in it start in its folder, those in
        ``params`` in the working directory.
    changes
        What the command line changes in it; a fault of such a value is told at its option.

    Returns
    -------
    Study
        With every default filled in. Nothing is computed, opened or written.

    Raises
    ------
    UserError
        One line that starts with ``file:line:column`` of the first fault.

    Examples
    --------
    >>> load_study("configs/quick.yaml").labels
    ('double_phase', 'gerchberg_saxton', 'wirtinger', 'oracle')
    """
    document, changes = load(Path(path)), changes or Changes()
    document = changed(replace(document, data=_long_form(document.data)), changes)
    study = replace(
        typed(document, Study, _long_form(document.data)), file=Path(path), text=document.text, changes=changes
    )
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
    for key, label in (("baseline", study.baseline), ("second_baseline", study.second_baseline)):
        if label and label not in study.labels:
            raise document.error((key,), f"no method has the label '{label}'; {suggest(label, study.labels)}")
    study = replace(study, baseline=study.baseline or study.labels[0])
    if not changes:
        return study
    note = f"{changes.note} {study.note}".strip()
    return replace(study, title=f"{study.title} (changed: {changes})", note=note)


def _long_form(data: Mapping[str, Any]) -> dict[str, Any]:
    """A config with every method as a mapping; a method without parameters may be just a name."""
    methods = data.get("methods")
    if not isinstance(methods, list):
        return dict(data)
    return {**data, "methods": [{"name": item} if isinstance(item, str) else item for item in methods]}


def _targets(study: Study, document: Document) -> Targets:
    with placed(document, ("targets", "dataset"), ("targets", "params")):
        dataset = study.dataset
        if not dataset.items():
            raise UserError(f"dataset '{study.targets.dataset}' has no images")
        if study.measure == "focus":
            planes_of(dataset, study.targets.dataset)
    return replace(study.targets, params=plugins.params_of(dataset), only=_only(study))


def _only(study: Study) -> tuple[str, ...]:
    """The targets that the command line left, none for all."""
    items, changes = study.dataset.items(), study.changes
    if not (changes.targets or changes.limit):
        return ()
    if study.measure == "focus":
        raise UserError("--targets, --limit: the targets of focal stacks are planes of scenes, and belong together")
    wanted = chosen("--targets", changes.targets, items, "target in the dataset") if changes.targets else items
    return tuple([item for item in items if item in wanted][: changes.limit])


def _training(study: Study, document: Document) -> Training:
    chosen = study.training
    with placed(document, ("training", "dataset"), ("training", "params")):
        dataset = plugins.build("datasets", chosen.dataset, dict(chosen.params), study.folder)
        count = len(dataset.items())
        if chosen.held_out >= count:
            raise UserError(f"training.held_out {chosen.held_out} leaves nothing of {count} images to train on")
    return replace(chosen, params=plugins.params_of(dataset))


def _holograms(study: Study, document: Document) -> Probe:
    chosen = study.holograms
    with placed(document, ("holograms", "name"), ("holograms", "params")):
        method = isolation.build(chosen.name, chosen.params, study.folder)
        if traits_of(method, chosen.name).trains:
            raise UserError(f"method '{chosen.name}' has to be trained; holograms should be of one that learns nothing")
    return replace(chosen, params=isolation.params_of(method))


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
        method = isolation.build(display.learned.method, display.learned.params, study.folder)
        traits = traits_of(method, display.learned.method)
        if not (traits.trains and "predict" in traits.functions):
            raise UserError(f"method '{display.learned.method}' learns no display; name one that predicts captures")
    return replace(display, learned=replace(display.learned, params=isolation.params_of(method)))


def _bench(study: Study, document: Document) -> DisplayGrid:
    if study.display.panel is not None:
        raise document.error(("display", "panel"), "a bench has the panel that its file says; remove 'panel'")
    if study.measure == "focus":
        raise document.error(("measure",), "focal stacks need a camera that refocuses; measure pictures or predictions")
    return study.display


def _protocol(study: Study, document: Document) -> Protocol:
    path = study.protocol.lpips_weights
    if path is None:
        return study.protocol
    weights = (study.folder / Path(path).expanduser()).resolve()
    where: Keys = ("protocol", "lpips_weights")
    with placed(document, where, where):
        if not (find_weights("alex", weights) or find_weights("vgg", weights)):
            raise UserError(f"no alexnet-*.pth or vgg16-*.pth in {weights}")
    return replace(study.protocol, lpips_weights=str(weights))


def _check_profiles(study: Study, document: Document) -> None:
    seen: dict[str, str] = {}
    learned = study.display.learned
    bench = study.display.bench
    for index, profile in enumerate([learned.profile] if learned else study.display.sources):
        where: Keys = ("display", "learned", "profile") if learned else ("display", "profiles", index)
        where = ("display", "bench") if bench else where
        with placed(document, where, where):
            read = real_condition(bench, study.folder) if bench else None
            display = read or condition(profile, study.display.panel, study.folder)
        name, region = display.name, display.spec.region.shape
        if min(region) < SMALLEST_REGION:
            message = f"'{name}' scores a window of {region[0]} x {region[1]} pixels of this panel"
            message += f"; registration needs at least {SMALLEST_REGION}"
            if study.display.panel and not bench:
                rows, columns = _smallest_panel(profile, study.display.panel, study.folder)
                message += f", which a panel of [{rows}, {columns}] has"
            raise document.error(("display", "panel"), message)
        if name in seen:
            raise document.error(
                where, f"'{profile}' and '{seen[name]}' are both named '{name}'; list each display once"
            )
        if name == REFERENCE:
            raise document.error(where, f"a profile may not be named '{REFERENCE}': the floor rows have that name")
        seen[name] = profile


def _smallest_panel(source: str, panel: tuple[int, int], folder: Path) -> tuple[int, int]:
    """The smallest panel, of at least these rows and columns, whose scored window is large enough for registration."""
    profile, side = load_profile(source, folder), SMALLEST_REGION
    while min(profile.spec((max(panel[0], side), max(panel[1], side))).region.shape) < SMALLEST_REGION:
        side += 1
    return max(panel[0], side), max(panel[1], side)


def _entry(study: Study, document: Document, index: int) -> MethodEntry:
    entry, where = study.methods[index], ("methods", index)
    with placed(document, (*where, "name"), (*where, "params")):
        method = isolation.build(entry.name, entry.params, study.folder)
        traits = traits_of(method, entry.name)
        if study.predicts and "predict" not in traits.functions:
            raise UserError(
                f"method '{entry.name}' predicts no captures; measure: {study.measure} needs methods that do"
            )
    place: Keys = (*where, "name") if (*where, "name") in document.keys else where
    apart = isinstance(method, isolation.Apart) and study.isolation != "none"
    if apart and (traits.privileged or method.refused):
        what = f"imports {method.refused}" if method.refused else "looks into the simulated bench"
        message = f"'{entry.name}' {what}, which a process of its own does not hold"
        raise document.error(place, f"{message}; a study with 'isolation: none' runs it")
    if study.display.real and traits.privileged:
        message = f"'{entry.name}' looks into a simulated bench; remove it from a study on a real one"
        raise document.error(place, message)
    if entry.captures is not None and (not traits.camera or study.predicts):
        message = f"'{entry.name}' takes no captures of a target here; remove 'captures'"
        raise document.error((*where, "captures"), message)
    profiles = subset(study, document, entry.profiles, (*where, "profiles"))
    label = entry.label or entry.name.rpartition(":")[2]
    return replace(entry, label=label, params=isolation.params_of(method), profiles=profiles)


def _check_labels(study: Study, document: Document) -> None:
    # Reports show neither a second space nor, in the names of files on some systems, the case of letters.
    alike = [" ".join(label.split()).casefold() for label in study.labels]
    for index, label in enumerate(study.labels):
        where: Keys = ("methods", index, "label")
        if (other := alike.index(alike[index])) < index:
            but = "" if label == study.labels[other] else ", but for spaces and capitals"
            message = f"methods[{index}] and methods[{other}] share the label '{label}'{but}; give one a 'label'"
            raise document.error(where, message)
        if not label.isprintable() or len(label) > 60 or label in FLOORS:
            raise document.error(where, f"label {label!r} should be printable, at most 60 characters and not a floor's")
    for label in study.reported.rows if study.reported else ():
        if label not in study.labels:
            message = f"no method has the label '{label}'; {suggest(label, study.labels)}"
            raise document.error(("reported", "rows", label), message, at_key=True)


def _check_twins(study: Study, document: Document) -> None:
    """Refuse two labels for the same cell: a measurement would be printed twice."""
    for index, entry in enumerate(study.methods):
        for other in study.methods[:index]:
            same = _measured(study, entry) == _measured(study, other)
            if same and set(entry.profiles) & set(other.profiles):
                message = f"methods[{index}] has the method, parameters and display of '{other.label}'; remove one"
                raise document.error(("methods", index), message)


def _measured(study: Study, entry: MethodEntry) -> tuple[object, ...]:
    """What sets the cells of an entry apart from those of others on the same display."""
    return entry.name, entry.params, entry.captures, entry.exposure or study.display.exposure


def sweep_of(study: Study, document: Document, index: int) -> Sweep:
    """A sweep of a config, its values and displays checked. UserError with ``file:line:column`` of a fault."""
    sweep, where = study.sweeps[index], ("sweeps", index)
    if study.display.learned or study.display.real or study.measure != "picture":
        raise document.error(where, "a sweep changes simulated displays, and scores pictures (measure: picture)")
    if sweep.condition not in KINDS:
        near = suggest(sweep.condition, KINDS)
        raise document.error((*where, "condition"), f"unknown condition '{sweep.condition}'; {near}")
    exposures = {entry.exposure or study.display.exposure for entry in study.methods}
    if sweep.condition == "laser_power" and "matched" in exposures:
        raise document.error(where, "exposure: matched undoes laser_power; leave one of the two out")
    countable = KINDS[sweep.condition].counted
    if bool(sweep.values) == (sweep.count is not None) or (sweep.count is not None and not countable):
        raise document.error(where, "a sweep has values; one of siblings or draws may have a count in their place")
    raw_values = sweep.values or tuple(str(number) for number in range(1, (sweep.count or 0) + 1))
    profiles = subset(study, document, sweep.profiles, (*where, "profiles"))
    same = [other for other in study.sweeps[:index] if other.condition == sweep.condition]
    values = [value for other in same if set(other.profiles) & set(profiles) for value in other.values]
    earlier_count = len(values)
    loaded = [load_profile(profile, folder=study.folder) for profile in profiles]
    for number, value in enumerate(raw_values):
        value_keys: Keys = (*where, "values", number) if sweep.values else (*where, "count")
        with placed(document, value_keys, value_keys):
            values.append(checked(sweep.condition, value))
            for profile in loaded:
                altered(profile, sweep.condition, values[-1])
        if values[-1] in values[:-1]:
            raise document.error(value_keys, f"{sweep.condition} {value} is listed twice")
    return replace(sweep, values=tuple(values[earlier_count:]), count=None, profiles=profiles)


def subset(study: Study, document: Document, named: tuple[str, ...], where: Keys) -> tuple[str, ...]:
    """The named displays in the study's order; all displays if none is named."""
    for number, profile in enumerate(named):
        if profile not in study.display.sources:
            message = f"'{profile}' is not in display.profiles; {suggest(profile, study.display.sources)}"
            raise document.error((*where, number), message)
    return tuple(p for p in study.display.sources if p in named or not named)


def check_metrics(study: Study, document: Document) -> None:
    """Refuse unknown metrics, a headline that no metric computes, and a headline that needs a larger window.

    Missing weights are no fault of the config; ``run.refuse_unscored`` reports them.
    """
    wanted, metrics = study.protocol.metrics, {metric.name: metric for metric in catalogue()}
    for index, name in enumerate(wanted or ()):
        if name not in (*metrics, "speckle_contrast"):
            message = f"unknown metric '{name}'; {suggest(name, [*metrics, 'speckle_contrast'])}"
            raise document.error(("protocol", "metrics", index), message)
    if study.measure == "focus" and study.headline in SCORES:
        return
    columns = {column: metric for metric in metrics.values() for column in metric.columns}
    if study.headline not in columns:
        choice = [*columns, *(SCORES if study.measure == "focus" else ())]
        raise document.error(("headline",), f"unknown metric '{study.headline}'; {suggest(study.headline, choice)}")
    metric = columns[study.headline]
    if wanted is not None and metric.name not in wanted:
        message = f"the headline is '{study.headline}'; add {metric.name} to the metrics, or set another 'headline'"
        raise document.error(("protocol", "metrics"), message)
    _check_window(metric, study, document)


def _check_window(metric: Metric, study: Study, document: Document) -> None:
    for display in displays(study).values() if metric.smallest > SMALLEST_REGION else ():
        height, width = display.spec.region.shape
        if min(height, width) < metric.smallest:
            message = f"'{display.name}' scores {height} x {width} pixels; {metric.name} needs {metric.smallest} a side"
            raise document.error(("headline",), message)
