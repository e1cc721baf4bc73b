"""The words of a report that are no results: the displays, the config, the machine, the rules that applied."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import MISSING, asdict, dataclass, fields, is_dataclass
from typing import TYPE_CHECKING, Any

import pandas as pd

from ...display.simulated.profile import Profile, load_profile
from ...display.simulated.stages import Panel
from ...study.displays import displays as conditions
from ...study.plan import REFERENCE
from ..data.layout import TrainingSet
from ..data.results import Results
from ..data.tables import DONE
from ..data.text import FILES, plain
from .alignment import agreement

if TYPE_CHECKING:
    from ...study.definition import Study
    from ...study.displays import Condition

TARGETS_NAMED = 40
EXPOSURES_PREDICTED = {
    "equal": "Equal light: the exposure of a capture follows from the target alone.",
    "matched": "Matched brightness: after a metering capture the laser power is set so that the region has the "
    "target's mean brightness.",
}
ON_A_NETWORK = {
    "registration": "None: the network predicts in the frame of the target, and nothing is captured.",
    "saturation": "None: there is no sensor.",
    "exposure": "Without effect: there is no noise, so that the unit of light changes no score.",
}

FROM_FILES = {
    "registration": "None by fiducials. Each target was found in its capture by the two pictures alone, as told "
    'under "Alignment".',
    "exposure": "Not known: pictures do not tell it, and the intensity match takes its effect on brightness away, not "
    "that on noise.",
}

EXPOSURES = {
    "equal": "Equal light: the exposure follows from the target alone and is the same for every method, so a method "
    "that wastes light is darker before the intensity match and noisier after it.",
    "matched": "Matched brightness: after a metering capture the laser power is set so that the region has the "
    "target's mean brightness; wasted light then costs no noise.",
}


@dataclass(frozen=True)
class Display:
    """A display as the report describes it: name, a heading line, and a line per property."""

    name: str
    heading: str
    lines: tuple[str, ...]


@dataclass(frozen=True)
class Description:
    """What the report says of a study besides its numbers; every field may be empty.

    config_file: the config as the user named it; config_text: what is in it; command: what writes the report again
    (empty: a run of the config).
    """

    displays: tuple[Display, ...] = ()
    config_file: str = ""
    config_text: str = ""
    command: str = ""


def describe(study: Study) -> Description:
    """The description of a checked study; reads its profiles."""
    if study.display.real:
        displays = tuple(_real(place) for place in conditions(study).values())
    elif study.display.learned is None:
        profiles = [load_profile(source, study.folder) for source in study.display.profiles]
        displays = tuple(_display(profile, study.display.panel) for profile in profiles)
    else:
        displays = tuple(_learned(place, study.display.learned.profile) for place in conditions(study).values())
    command = "holoeval session import with the session's folder" if study.display.session else ""
    file = study.file.name if study.file.is_absolute() else study.file.as_posix()
    return Description(displays, file, study.text, command)


def _learned(place: Condition, profile: str) -> Display:
    needed = place.learned
    assert needed is not None
    return Display(
        name=place.name,
        heading=f"The frozen network of {needed.method}, trained on captures of {profile}; no noise, no camera.",
        lines=(f"artifact: {needed.name}", f"parameters: {plain(dict(needed.params))}"),
    )


def _real(place: Condition) -> Display:
    rig, spec = place.real, place.spec
    assert rig is not None
    way = f"photographs exchanged as files, session {rig.session[:16]}" if rig.session else "photographed live"
    wavelengths = ", ".join(f"{value * 1e9:.4g}" for value in spec.wavelengths)
    iris = f"an iris of {spec.pupil:g} of the band" if spec.pupil else "no iris"
    return Display(
        name=place.name,
        heading=f"Version {place.version}, sha256 {place.digest[:16]}. A real bench, {way}; only its nominal optics "
        "are known, and an efficiency of 1 is the nominal one.",
        lines=(
            f"panel: {spec.shape[0]} x {spec.shape[1]} pixels, {spec.distance * 1e3:.4g} mm",
            f"optics: pitch {spec.pitch * 1e6:.4g} um, wavelengths {wavelengths} nm, {spec.bits} bit, {iris}",
        ),
    )


def _display(profile: Profile, panel: tuple[int, int] | None) -> Display:
    nominal = profile.scaled(panel).panel
    wavelengths = ", ".join(f"{value * 1e9:.4g}" for value in nominal.wavelengths)
    iris = f"an iris of {nominal.pupil:g} of the band" if nominal.pupil else "no iris"
    return Display(
        name=profile.name,
        heading=f"Version {profile.version}, sha256 {profile.digest[:16]}. {profile.description}",
        lines=(
            f"panel: {profile.scaling_note(panel)}",
            f"optics: pitch {nominal.pitch * 1e6:.4g} um, wavelengths {wavelengths} nm, {nominal.bits} bit, {iris}",
            *_stages(profile),
        ),
    )


def _stages(profile: Profile) -> list[str]:
    """A line for every stage of the bench whose parameters are not the neutral ones."""
    lines = []
    for item in fields(profile):
        stage = getattr(profile, item.name)
        neutral = item.default_factory() if item.default_factory is not MISSING else item.default
        if is_dataclass(stage) and not isinstance(stage, type | Panel) and stage != neutral:
            lines.append(f"{item.name.replace('_', ' ')}: {plain(asdict(stage))}")
    return lines


def counts(results: Results) -> str:
    """How large the study is, in one sentence."""
    cells = results.frame[results.frame["condition"] != REFERENCE]
    done = int((cells["state"] == DONE).sum())
    parts = (
        (len(results.targets), "target"),
        (cells["method"].nunique(), "method"),
        (len(results.conditions), "display"),
        (cells["repeat"].nunique(), "repeat"),
    )
    size = ", ".join(f"{count} {noun}{'' if count == 1 else 's'}" for count, noun in parts)
    return f"{size}: {len(cells)} cells, {done} with a score, {len(cells) - done} without."


def setup(results: Results, records: Sequence[Mapping[str, Any]]) -> list[tuple[str, str]]:
    """Name and value of everything that was the same for all methods."""
    if results.layout.measure == FILES:
        return _files(results, records)
    cells = [record["cell"] for record in records]
    named = ", ".join(results.targets[:TARGETS_NAMED])
    more = len(results.targets) - TARGETS_NAMED
    sets = dict.fromkeys(f"{cell['dataset']} ({plain(cell['dataset_params'])})" for cell in cells)
    panels = dict.fromkeys(" x ".join(map(str, cell["panel"])) + " pixels" for cell in cells)
    layout = results.layout
    measured = [("measured", f"predictions of the captures of holograms by {layout.holograms}")]
    return [
        *(measured if layout.measure == "prediction" else []),
        ("targets", f"{len(results.targets)}: {named}{f' and {more} more' if more > 0 else ''}"),
        ("dataset", "; ".join(sets)),
        *([("training images", training_images(layout.training))] if layout.training else []),
        ("panel", "; ".join(panels)),
        ("exposure", _distinct(results.frame, "exposure")),
        ("metric protocol", _distinct(results.frame, "protocol")),
        ("repeats", str(results.frame["repeat"].nunique())),
        ("seed", str(layout.seed)),
        ("headline metric", results.headline.axis),
        ("baseline", layout.baseline or "none"),
    ]


def training_images(given: TrainingSet) -> str:
    """What methods may train on, in a line."""
    limit = "no limit on captures" if given.captures is None else f"at most {given.captures} captures"
    return f"{given.images} of {given.dataset}, of which {given.held_out} only watch the training; {limit}"


def _files(results: Results, records: Sequence[Mapping[str, Any]]) -> list[tuple[str, str]]:
    """What was the same for all methods whose pictures were given."""
    cells = [record["cell"] for record in records if record["cell"]["condition"] != REFERENCE]
    sizes = dict.fromkeys(" x ".join(map(str, cell["panel"])) for cell in cells if cell["panel"])
    named = ", ".join(results.targets[:TARGETS_NAMED])
    more = len(results.targets) - TARGETS_NAMED
    return [
        ("targets", f"{len(results.targets)}: {named}{f' and {more} more' if more > 0 else ''}"),
        ("size of the captures", f"{'; '.join(sizes)} pixels"),
        ("compared", results.layout.wording.compared),
        ("metric protocol", _distinct(results.frame, "protocol")),
        ("headline metric", results.headline.axis),
        ("baseline", results.layout.baseline or "none"),
    ]


def _at_full_scale(results: Results) -> str:
    done = results.frame[(results.frame["state"] == DONE) & (results.frame["condition"] != REFERENCE)]
    most = done["saturated"].max() if len(done) else float("nan")
    if not most >= 0:
        return "Not recorded."
    doubt = " Above 0.1 % highlights were cut, and a study on a bench would refuse the capture." if most > 0.001 else ""
    return f"At most {100 * most:.3g} % of a capture's samples in the scored region are at full scale.{doubt}"


def _distinct(frame: pd.DataFrame, column: str) -> str:
    return ", ".join(sorted(set(frame[column]) - {""}))


def method_parameters(results: Results, records: Sequence[Mapping[str, Any]]) -> list[tuple[str, str, str]]:
    """(label, registered name, parameters) of every method, in the order of the tables."""
    found = {
        record["label"]: (record["cell"]["method"], plain(record["cell"]["params"]) + _allowed(record["cell"]))
        for record in records
        if record["cell"]["condition"] != REFERENCE
    }
    order = dict.fromkeys(results.table.loc[results.table["condition"] != REFERENCE, "method"])
    return [(label, *found[label]) for label in order]


def _allowed(cell: Mapping[str, Any]) -> str:
    """The most captures that the display allows for a target, where the study limits them."""
    return f"; at most {cell['captures']} captures per target" if cell.get("captures") else ""


def rules(results: Results) -> dict[str, str]:
    """Sentences on registration, exposure and saturation, with this study's figures."""
    if results.layout.learned_display is not None:
        return ON_A_NETWORK
    if results.layout.measure == FILES:
        return FROM_FILES | {"saturation": _at_full_scale(results)}
    done = results.frame[(results.frame["state"] == DONE) & (results.frame["condition"] != REFERENCE)]
    saturated = done["saturated"].dropna()
    changed = done["condition"].isin(results.layout.changed)
    named = done["condition"].where(~changed, "displays after a change")
    residuals = [
        f"{condition} {' to '.join(dict.fromkeys(f'{end:.3f}' for end in (cells.min(), cells.max())))} px"
        for condition, cells in done.groupby(named, sort=False)["registration_residual_px"]
        if cells.notna().any()
    ]
    registration = (
        "Holograms of a circle grid fix the geometry once per display, the same for all methods. Residuals (rms, in "
        f"pixels of the scored region): {', '.join(residuals)}."
        if residuals
        else "No residual was recorded."
    )
    if results.layout.real:
        registration = f"{registration} {agreement(results)}".strip()
    refused = "; above 0.1 % a capture is refused" if results.layout.measure != "prediction" else ""
    saturation = (
        f"At most {100 * saturated.max():.3g} % of a capture's samples{refused}." if len(saturated) else "Not recorded."
    )
    known = EXPOSURES if results.layout.measure != "prediction" else EXPOSURES_PREDICTED
    policies = sorted(set(results.frame["exposure"]) - {""})
    exposure = " ".join(known.get(policy, policy) for policy in policies) or "Not recorded."
    return {"registration": registration, "saturation": saturation, "exposure": exposure}


def environment(provenance: Mapping[str, Any]) -> list[tuple[str, str]]:
    """What the run used, as far as it is the same for two equal runs: no times, no paths, no revisions."""
    single = {"package": "holobench_eval", "python": "Python", "platform": "platform", "cpu": "processor", "gpu": "GPU"}
    numbers = {"threads": "threads per worker", "workers": "workers", "config_sha256": "sha256 of the config"}
    named = [(title, str(provenance[key])) for key, title in (single | numbers).items() if key in provenance]
    return [*named, *((name, str(value)) for name, value in provenance.get("packages", {}).items())]
