"""What a report says of a study besides its numbers: the displays, the config, the command."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from dataclasses import MISSING, dataclass, field, fields, is_dataclass
from pathlib import Path
from types import MappingProxyType

from ..core.installed import as_typed
from ..display.api import DisplaySpec
from ..display.simulated.origins import families, fit_of
from ..display.simulated.profile import Profile, load_profile, names
from ..display.simulated.stages import Panel
from ..study import isolation
from ..study.definition import Study
from ..study.displays import Condition
from ..study.displays import displays as conditions
from .text import plain, words


@dataclass(frozen=True)
class Display:
    """A display as the report describes it: name, a heading line, and a line per property.

    basis: what it is and where its parameters come from, in a sentence; modelled: how many effects of a simulated
    display the model of a method has terms for, and of how many, by the method's label.
    """

    name: str
    heading: str
    lines: tuple[str, ...]
    basis: str = ""
    modelled: Mapping[str, tuple[int, int]] = field(default_factory=dict)


@dataclass(frozen=True)
class Description:
    """What the report says of a study besides its numbers; every field may be empty.

    config_file: the config as the user named it; config_text: what is in it; command: what writes the report again
    (empty: a run of the config); models: what is known of the twins that methods descend through, by label.
    """

    displays: tuple[Display, ...] = ()
    config_file: str = ""
    config_text: str = ""
    command: str = ""
    models: Mapping[str, str] = field(default_factory=dict)


def describe(study: Study) -> Description:
    """The description of a checked study; reads its profiles."""
    if study.display.real:
        displays = tuple(_real(condition) for condition in conditions(study).values())
    elif study.display.learned is None:
        profiles = [load_profile(source, study.folder) for source in study.display.profiles]
        traits = {entry.label: isolation.traits(entry.name, study.folder) for entry in study.methods}
        forms = {label: method.form for label, method in traits.items() if method.form is not None}
        displays = tuple(simulated(profile, study.display.panel, forms) for profile in profiles)
    else:
        profile = study.display.learned.profile
        displays = tuple(_learned(condition, profile) for condition in conditions(study).values())
    typed = Path(as_typed(study.config))
    file = (Path(study.file.name, study.part) if typed.is_absolute() else typed).as_posix()
    command = "holoeval session import with the session's folder" if study.display.session else ""
    command = f"holoeval run {shlex.quote(file)} {study.changes}" if study.changes else command
    return Description(displays, file, study.text, command, _models(study))


def _models(study: Study) -> dict[str, str]:
    """What is known of the twins that methods descend through."""
    through = {entry.label: entry.params["profile"] for entry in study.methods if entry.name == "through"}
    known = {label: load_profile(str(profile), study.folder).twin.words for label, profile in through.items()}
    return {label: words for label, words in known.items() if words}


def _learned(condition: Condition, profile: str) -> Display:
    network = condition.learned
    assert network is not None
    return Display(
        name=condition.name,
        heading=f"The frozen network of {network.method}, trained on captures of {profile}; no noise.",
        lines=(f"artifact: {network.name}", f"parameters: {plain(dict(network.params))}"),
    )


def _real(condition: Condition) -> Display:
    rig, spec = condition.real, condition.spec
    assert rig is not None
    way = f"photographs exchanged as files, session {rig.session[:16]}" if rig.session else "photographed live"
    return Display(
        name=condition.name,
        heading=f"Version {condition.version}, sha256 {condition.digest[:16]}. A real bench, {way}; only its nominal "
        f"optics are known, and an efficiency of 1 is the nominal one{_gray(spec)}.",
        lines=(f"panel: {spec.shape[0]} x {spec.shape[1]} pixels, {spec.distance * 1e3:.4g} mm", _optics(spec)),
    )


def simulated(
    profile: Profile, panel: tuple[int, int] | None, forms: Mapping[str, frozenset[str]] = MappingProxyType({})
) -> Display:
    """A simulated display on a panel (None: its full one). forms: the effects that methods model, by label."""
    effects = [effect.name for effect in profile.effects()]
    return Display(
        name=profile.name,
        heading=f"Version {profile.version}, sha256 {profile.digest[:16]}. {profile.description}",
        lines=(f"panel: {profile.scaling_note(panel)}", _optics(profile.scaled(panel).panel), _stages(profile)),
        basis=f"{basis(profile)}{_gray(profile.panel)}",
        modelled={label: (len(form.intersection(effects)), len(effects)) for label, form in forms.items()},
    )


def basis(profile: Profile) -> str:
    """Where the parameters of a simulated display come from."""
    measured = "simulated, with parameters that are assumed or from data sheets"
    if profile.network.method:
        return ", ".join(filter(None, (f"predicted by a trained {profile.network.method}", profile.twin.words)))
    if profile.twin.of:
        return f"simulated, {profile.twin.words}"
    if profile.held:
        return f"simulated, with maps that the profile gives as measured: {', '.join(profile.held)}"
    if profile.name in {*names(family=True), *families()}:
        return "simulated, chosen for reproducing the published PSNR"
    if (fit := fit_of(profile)) is None:
        return measured
    free = words([name.replace(".", " ").replace("_", " ") for name in fit["free"]])
    return f"simulated, with {free} fitted to published PSNR, so that agreement with it is no evidence"


def _gray(panel: Panel | DisplaySpec) -> str:
    return "; of one wavelength, so that targets are gray" if len(panel.wavelengths) == 1 else ""


def _optics(panel: Panel | DisplaySpec) -> str:
    wavelengths = ", ".join(f"{value * 1e9:.4g}" for value in panel.wavelengths)
    iris = f"an iris of {panel.pupil:g} of the band" if panel.pupil else "no iris"
    if panel.plane == "fourier":
        iris = f"image in the Fourier plane of a lens, {1 / (panel.pupil or 1):.3g} pixels to a resolved one"
    frames = f", up to {panel.frames} frames an exposure" if panel.frames > 1 else ""
    return f"optics: pitch {panel.pitch * 1e6:.4g} um, wavelengths {wavelengths} nm, {panel.bits} bit, {iris}{frames}"


def _stages(profile: Profile) -> str:
    """The stages of the bench whose parameters are not the neutral ones; the profile has the values."""
    names = []
    for item in fields(profile):
        stage = getattr(profile, item.name)
        neutral = item.default_factory() if item.default_factory is not MISSING else item.default
        if is_dataclass(stage) and not isinstance(stage, type | Panel) and stage != neutral:
            names.append(item.name.replace("_", " "))
    return f"stages with effects: {', '.join(names) or 'none'}"
