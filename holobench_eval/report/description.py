"""The words of a report that are no results: the displays, the config, the machine, the rules that applied."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import MISSING, asdict, dataclass, fields, is_dataclass
from typing import TYPE_CHECKING, Any

import pandas as pd

from ..display.profile import Panel, Profile, load_profile
from ..study.plan import REFERENCE
from .results import Results
from .tables import DONE

if TYPE_CHECKING:
    from ..config import Study

TARGETS_NAMED = 40

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

    config_file: the config as the user named it; config_text: what is in it.
    """

    displays: tuple[Display, ...] = ()
    config_file: str = ""
    config_text: str = ""


def describe(study: Study) -> Description:
    """The description of a checked study; reads its profiles."""
    profiles = [load_profile(source, study.folder) for source in study.display.profiles]
    displays = tuple(_display(profile, study.display.panel) for profile in profiles)
    return Description(displays, study.file.name if study.file.is_absolute() else study.file.as_posix(), study.text)


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


def plain(values: Mapping[str, Any]) -> str:
    """``a = 1, b = [2, 3]``: parameters as text on one line."""
    return ", ".join(f"{key} = {_value(value)}" for key, value in values.items()) or "none"


def _value(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:g}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_value, value))}]"
    if isinstance(value, Mapping):
        return f"({plain(value)})"
    return "none" if value is None else str(value)


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
    cells = [record["cell"] for record in records]
    named = ", ".join(results.targets[:TARGETS_NAMED])
    more = len(results.targets) - TARGETS_NAMED
    sets = dict.fromkeys(f"{cell['dataset']} ({plain(cell['dataset_params'])})" for cell in cells)
    panels = dict.fromkeys(" x ".join(map(str, cell["panel"])) + " pixels" for cell in cells)
    layout = results.layout
    return [
        ("targets", f"{len(results.targets)}: {named}{f' and {more} more' if more > 0 else ''}"),
        ("dataset", "; ".join(sets)),
        ("panel", "; ".join(panels)),
        ("exposure", _distinct(results.frame, "exposure")),
        ("metric protocol", _distinct(results.frame, "protocol")),
        ("repeats", str(results.frame["repeat"].nunique())),
        ("seed", str(layout.seed)),
        ("headline metric", results.headline.axis),
        ("baseline", layout.baseline or "none"),
    ]


def _distinct(frame: pd.DataFrame, column: str) -> str:
    return ", ".join(sorted(set(frame[column]) - {""}))


def method_parameters(results: Results, records: Sequence[Mapping[str, Any]]) -> list[tuple[str, str, str]]:
    """(label, registered name, parameters) of every method, in the order of the tables."""
    found = {
        record["label"]: (record["cell"]["method"], plain(record["cell"]["params"]))
        for record in records
        if record["cell"]["condition"] != REFERENCE
    }
    order = dict.fromkeys(results.table.loc[results.table["condition"] != REFERENCE, "method"])
    return [(label, *found[label]) for label in order]


def rules(results: Results) -> dict[str, str]:
    """Sentences on registration, exposure and saturation, with this study's figures."""
    done = results.frame[(results.frame["state"] == DONE) & (results.frame["condition"] != REFERENCE)]
    saturated = done["saturated"].dropna()
    residuals = [
        f"{condition} {' to '.join(dict.fromkeys(f'{end:.3f}' for end in (cells.min(), cells.max())))} px"
        for condition, cells in done.groupby("condition", sort=False)["registration_residual_px"]
        if cells.notna().any()
    ]
    registration = (
        "Holograms of a circle grid fix the geometry once per display, the same for all methods. Residuals (rms, in "
        f"pixels of the scored region): {', '.join(residuals)}."
        if residuals
        else "No residual was recorded."
    )
    saturation = (
        f"At most {100 * saturated.max():.3g} % of a capture's samples; above 0.1 % a capture is refused."
        if len(saturated)
        else "Not recorded."
    )
    policies = sorted(set(results.frame["exposure"]) - {""})
    exposure = " ".join(EXPOSURES.get(policy, policy) for policy in policies) or "Not recorded."
    return {"registration": registration, "saturation": saturation, "exposure": exposure}


def environment(provenance: Mapping[str, Any]) -> list[tuple[str, str]]:
    """What the run used, as far as it is the same for two equal runs: no times, no paths, no revisions."""
    single = {"package": "holobench_eval", "python": "Python", "platform": "platform", "cpu": "processor"}
    numbers = {"threads": "threads per worker", "workers": "workers", "config_sha256": "sha256 of the config"}
    named = [(title, str(provenance[key])) for key, title in (single | numbers).items() if key in provenance]
    return [*named, *((name, str(value)) for name, value in provenance.get("packages", {}).items())]
