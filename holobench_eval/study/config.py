"""Read a study from ``configs/*.yaml`` and check all of it before anything runs.

Every mistake in a config is reported in one line that starts with its position, ``configs/table3.yaml:12:5: ...``.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from ..core import plugins
from ..core.errors import UserError, suggest
from ..core.parts import divided, load_config
from ..core.schema import placed, typed
from ..core.yaml_source import Document, Keys
from ..display import DisplaySpec
from ..display.simulated.changes import KINDS, Value, altered, checked
from ..display.simulated.profile import load_profile
from ..display.traits import refuse_plane, traits_of
from ..imaging.grid import SMALLEST_REGION
from ..metrics import catalogue, control
from ..metrics.lpips import find_weights
from . import isolation
from .changes import Changes, changed, chosen
from .definition import STACKS, DisplayGrid, MethodEntry, Probe, Protocol, Study, Sweep, Targets, Training
from .displays import condition, displays, real_condition
from .identity import SPECKLE
from .plan import FLOORS, REFERENCE, is_reference
from .stacks import SCORES, stacks_of


def load_study(path: Path | str, changes: Changes | None = None) -> Study:
    """Read a study and check all of it.

    Parameters
    ----------
    path
        A YAML file, or a part of one such as ``depth.yaml/frames``; relative paths of code, profiles, benches and
        weights in it start in its folder, other ones in ``params`` in the working directory.
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
    ('double_phase', 'gerchberg_saxton', 'wirtinger', 'hil_plus')
    """
    (file, part), document, changes = divided(Path(path)), load_config(Path(path)), changes or Changes()
    document = changed(replace(document, data=_long_form(document.data)), changes, Study.__dataclass_fields__)
    study = typed(document, Study, _long_form(document.data))
    for other in map(load_config, [file / name for name in study.parts]):  # before the first of them is run
        typed(other, Study, _long_form(other.data))
    study = _with_grids(replace(study, file=file, part=part, text=document.text, changes=changes), document)
    study = _with_chosen_methods(study)
    study = replace(study, targets=_targets(study, document), protocol=_protocol(study, document))
    study = replace(study, training=_training(study, document), holograms=_holograms(study, document))
    study = replace(study, display=_display(study, document))
    specs = _specs(study, document)
    study = replace(study, methods=tuple(_entry(study, document, entry, specs) for entry in study.methods))
    study = replace(study, sweeps=tuple(_sweeps(study, document)))
    _check_labels(study, document)
    _check_metrics(study, document)
    if study.reported and study.reported.beside:
        _subset(study, document, (study.reported.beside,), ("reported", "beside"))
    study = replace(study, baseline=study.baseline or study.labels[0])
    if not changes:
        return study
    note = f"This is not the whole study of the config, and not its result: it was run with {changes}. {study.note}"
    return replace(study, title=f"{study.title} (changed: {changes})", note=note.strip())


def _long_form(data: Mapping[str, Any]) -> dict[str, Any]:
    """A config with every method as a mapping; a method without parameters may be just a name."""
    methods = data.get("methods")
    if not isinstance(methods, list):
        return dict(data)
    return {**data, "methods": [{"name": item} if isinstance(item, str) else item for item in methods]}


def _with_grids(study: Study, document: Document) -> Study:
    """The study with all combinations of its grids. Each has its place in the config, a label and an exposure."""
    entries = list[MethodEntry]()
    for row, entry in enumerate(study.methods):
        for key in entry.grid:
            if key in entry.params:
                where: Keys = ("methods", row, "grid", key)
                raise document.error(where, f"'{key}' stands in params, too; keep one of the two", at_key=True)
        placed_entry = replace(entry, row=row, exposure=entry.exposure or study.display.exposure)
        entries += placed_entry.combinations()
    return replace(study, methods=tuple(entries))


def _with_chosen_methods(study: Study) -> Study:
    """The study with the methods that the command line left: those of a label, and all of a name that is no label."""
    allowed = dict.fromkeys([*study.labels, *(entry.name for entry in study.methods)])
    wanted = chosen("--methods", study.changes.methods, [*allowed], "method in the config") or study.labels
    names = {*wanted} - {*study.labels}
    return study.with_methods(entry for entry in study.methods if entry.label in wanted or entry.name in names)


def _targets(study: Study, document: Document) -> Targets:
    with placed(document, ("targets", "dataset"), ("targets", "params")):
        dataset = study.dataset
        if not dataset.items():
            raise UserError(f"dataset '{study.targets.dataset}' has no images")
        stacks_of(dataset, study.targets.dataset, study.measure)
    return replace(study.targets, params=plugins.params_of(dataset), only=_only(study))


def _only(study: Study) -> tuple[str, ...]:
    """The targets that the command line left, none for all."""
    items, changes = study.dataset.items(), study.changes
    if not (changes.targets or changes.limit):
        return ()
    if study.measure in STACKS:
        raise UserError("--targets, --limit: the targets are planes or views of scenes, and belong together")
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
    display, learned = study.display, study.display.learned
    named = [name for name in ("profiles", "learned", "bench") if getattr(display, name)]
    if len(named) != 1:
        message = "display.profiles, display.learned or display.bench: name displays in one of the three"
        raise document.error(("display", named[-1] if named else "profiles"), message)
    if display.bench and display.panel is not None:
        raise document.error(("display", "panel"), "a bench has the panel that its file says; remove 'panel'")
    if display.bench and study.measure in STACKS:
        message = f"needs a camera that {STACKS[study.measure]}; measure pictures or predictions"
        raise document.error(("measure",), f"measure: {study.measure} {message}")
    if learned is None:
        return display
    if study.measure != "picture":
        raise document.error(("measure",), "a learned display is a prediction already; measure its pictures")
    with placed(document, ("display", "learned", "method"), ("display", "learned", "params")):
        method = isolation.build(learned.method, learned.params, study.folder)
        traits = traits_of(method, learned.method)
        if not (traits.trains and "predict" in traits.functions):
            raise UserError(f"method '{learned.method}' learns no display; name one that predicts captures")
    return replace(display, learned=replace(learned, params=isolation.params_of(method)))


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


def _specs(study: Study, document: Document) -> dict[str, DisplaySpec]:
    """The nominal optics of each display, by its name in the config. UserError: a display that has no place in it."""
    seen, specs = {REFERENCE: "the floor rows"}, dict[str, DisplaySpec]()
    learned, bench, panel = study.display.learned, study.display.bench, study.display.panel
    for index, source in enumerate(study.display.sources):
        profile = learned.profile if learned else source
        where: Keys = ("display", "bench") if bench else ("display", "profiles", index)
        where = ("display", "learned", "profile") if learned else where
        with placed(document, where, where):
            display = real_condition(bench, study.folder) if bench else condition(profile, panel, study.folder)
            if (taken := REFERENCE if is_reference(display.name) else display.name) in seen:
                both = f"'{profile}' and '{seen[taken]}' are both named '{display.name}'"
                raise UserError(f"{both}; list each display once")
            if learned:
                refuse_plane(isolation.traits(learned.method, study.folder), learned.method, display.spec)
        needs = f"measure: {study.measure}"
        if study.measure in STACKS and display.network:
            raise document.error(("measure",), f"{needs} moves planes; '{profile}' is a network")
        if study.measure in STACKS and display.spec.plane == "fourier":
            raise document.error(("measure",), f"{needs} needs a Fresnel plane; '{profile}' has a Fourier plane")
        name, region = display.name, display.spec.region.shape
        if min(region) < SMALLEST_REGION:
            message = f"'{name}' scores a window of {region[0]} x {region[1]} pixels of this panel"
            message += f"; registration needs at least {SMALLEST_REGION}"
            if panel and not bench and min(load_profile(profile, study.folder).spec().region.shape) >= SMALLEST_REGION:
                message += f", which a panel of {list(_smallest_panel(profile, panel, study.folder))} has"
            raise document.error(("display", "panel"), message)
        seen[name], specs[source] = profile, display.spec
    return specs


def _smallest_panel(source: str, panel: tuple[int, int], folder: Path) -> tuple[int, int]:
    """The smallest panel, of at least these rows and columns, whose scored window is large enough for registration."""
    profile, side = load_profile(source, folder), SMALLEST_REGION
    most_rows, most_columns = profile.panel.shape
    while min(profile.spec(panel).region.shape) < SMALLEST_REGION:
        panel, side = (min(max(panel[0], side), most_rows), min(max(panel[1], side), most_columns)), side + 1
    return panel


def _entry(study: Study, document: Document, entry: MethodEntry, specs: Mapping[str, DisplaySpec]) -> MethodEntry:
    where = ("methods", entry.row)
    with placed(document, (*where, "name"), (*where, "params"), (*where, "grid")):
        method = isolation.build(entry.name, entry.params, study.folder)
        traits = traits_of(method, entry.name)
        if study.predicts and "predict" not in traits.functions:
            needs = f"measure: {study.measure} needs methods that do"
            raise UserError(f"method '{entry.name}' predicts no captures; {needs}")
        apart = isinstance(method, isolation.Apart) and study.isolation != "none"
        if apart and (traits.privileged or method.refused):
            what = f"imports {method.refused}" if method.refused else "looks into the simulated bench"
            what += ", which a process of its own does not hold"
            raise UserError(f"'{entry.name}' {what}; a study with 'isolation: none' runs it")
        if study.display.real and traits.privileged:
            raise UserError(f"'{entry.name}' looks into a simulated bench; remove it from a study on a real one")
    if entry.captures is not None and (not traits.camera or study.predicts):
        fault = f"'{entry.name}' takes no captures of a target here; remove 'captures'"
        raise document.error((*where, "captures"), fault)
    profiles = _subset(study, document, entry.profiles, (*where, "profiles"))
    with placed(document, (*where, "name"), (*where, "name")):
        for source in profiles:
            refuse_plane(traits, entry.name, specs[source])
            if traits.privileged and study.display.profiles and load_profile(source, study.folder).network.method:
                raise UserError(f"'{entry.name}' looks into a simulated bench, and '{source}' is a network")
            if hasattr(method, "refuse_display"):
                method.refuse_display(specs[source])
    return replace(entry, params=isolation.params_of(method), profiles=profiles)


def _check_labels(study: Study, document: Document) -> None:
    """Refuse labels that a table cannot show or that no method has, and two of them for the same cell."""
    # Reports show neither a second space nor, in the names of files on some systems, the case of letters.
    alike = [" ".join(label.split()).casefold() for label in study.labels]
    measured = [replace(entry, label="", profiles=(), row=0) for entry in study.methods]
    for index, entry in enumerate(study.methods):
        label, where = entry.label, ("methods", entry.row, "label")
        first = study.methods[alike.index(alike[index])]
        if first is not entry:
            but = "" if label == first.label else ", but for spaces and capitals"
            if first.row == entry.row:
                raise document.error((*where[:2], "grid"), f"two rows are named '{label}'; list each value once")
            both = f"methods[{entry.row}] and methods[{first.row}] share the label '{label}'"
            raise document.error(where, f"{both}{but}; give one a 'label'")
        if not label.isprintable() or len(label) > 60 or label in {*FLOORS, "floor"}:
            raise document.error(where, f"label {label!r} should be printable, at most 60 characters and not a floor's")
        for earlier, other in enumerate(study.methods[:index]):  # a measurement would be printed twice
            if measured[index] == measured[earlier] and set(entry.profiles) & set(other.profiles):
                message = f"methods[{entry.row}] has the method, parameters and display of '{other.label}'; remove one"
                raise document.error(where[:2], message)
    named: dict[Keys, str] = {("baseline",): study.baseline}
    named |= {("reported", "rows", label): label for label in (study.reported.rows if study.reported else ())}
    for place, label in named.items():
        if label:
            _refuse_unknown(document, place, label, study.labels, f"no method has the label '{label}'")


def _sweeps(study: Study, document: Document) -> Iterator[Sweep]:
    """The sweeps with their values and displays checked. UserError with ``file:line:column`` of a fault."""
    seen = set[tuple[str, str, Value]]()
    for index, sweep in enumerate(study.sweeps):
        where = ("sweeps", index)
        if study.display.learned or study.display.real or study.measure != "picture":
            raise document.error(where, "a sweep changes simulated displays, and scores pictures (measure: picture)")
        kind = sweep.condition
        _refuse_unknown(document, (*where, "condition"), kind, KINDS, f"unknown condition '{kind}'")
        if kind == "laser_power" and "matched" in {entry.exposure for entry in study.methods}:
            raise document.error(where, "exposure: matched undoes laser_power; leave one of the two out")
        countable = KINDS[kind].counted
        if bool(sweep.values) == (sweep.count is not None) or (sweep.count is not None and not countable):
            raise document.error(where, "a sweep has values; one of siblings or draws may have a count in their place")
        profiles = _subset(study, document, sweep.profiles, (*where, "profiles"))
        loaded = [load_profile(profile, folder=study.folder) for profile in profiles]
        values: list[Value] = []
        for number, given in enumerate(sweep.values or map(str, range(1, (sweep.count or 0) + 1))):
            place: Keys = (*where, "values", number) if sweep.values else (*where, "count")
            with placed(document, place, place):
                values.append(checked(kind, given))
                for profile in loaded:
                    altered(profile, kind, values[-1])
            shown = {(kind, source, values[-1]) for source in profiles}
            if seen & shown:
                raise document.error(place, f"{kind} {given} is listed twice")
            seen |= shown
        yield replace(sweep, values=tuple(values), count=None, profiles=profiles)


def _subset(study: Study, document: Document, named: tuple[str, ...], where: Keys) -> tuple[str, ...]:
    """The named displays in the study's order; all displays if none is named."""
    sources = study.display.sources
    for number, source in enumerate(named):
        _refuse_unknown(document, (*where, number), source, sources, f"'{source}' is not in display.profiles")
    return tuple(source for source in sources if source in named or not named)


def _check_metrics(study: Study, document: Document) -> None:
    """Refuse unknown metrics, a headline that no metric computes, and a headline that needs a larger window.

    Missing weights are no fault of the config; ``run.refuse_unscored`` reports them.
    """
    wanted, headline, metrics = study.protocol.metrics, study.headline, {metric.name: metric for metric in catalogue()}
    for index, name in enumerate(wanted or ()):
        where: Keys = ("protocol", "metrics", index)
        _refuse_unknown(document, where, name, [*metrics, SPECKLE, control.NAME], f"unknown metric '{name}'")
        if name == control.NAME and not study.predicts:
            raise document.error(where, "control is a score of models; measure: prediction or error_budget has it")
        if name == control.NAME and "matched" in {entry.exposure for entry in study.methods}:
            raise document.error(where, "control compares captures of equal light; leave out exposure: matched")
    columns = {column: metric for metric in metrics.values() for column in metric.columns}
    further = SCORES if study.measure == "focus" else ()
    _refuse_unknown(document, ("headline",), headline, [*columns, *further], f"unknown metric '{headline}'")
    if headline in further:
        return
    metric = columns[headline]
    if wanted is not None and metric.name not in wanted:
        message = f"the headline is '{headline}'; add {metric.name} to the metrics, or set another 'headline'"
        raise document.error(("protocol", "metrics"), message)
    for display in displays(study).values() if metric.smallest > SMALLEST_REGION else ():
        height, width = display.spec.region.shape
        if min(height, width) < metric.smallest:
            message = f"'{display.name}' scores {height} x {width} pixels; {metric.name} needs {metric.smallest} a side"
            raise document.error(("headline",), message)


def _refuse_unknown(document: Document, where: Keys, word: str, allowed: Collection[str], fault: str) -> None:
    """UserError at a place, with what is near, for a word that is not allowed."""
    if word not in allowed:
        is_key = where[:2] == ("reported", "rows")
        raise document.error(where, f"{fault}; {suggest(word, allowed)}", is_key)
